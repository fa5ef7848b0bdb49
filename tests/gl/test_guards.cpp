// Guards against degenerate elements: no bit where none triggers, counted where one does.
#include <doctest/doctest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "sim/gl/gpu.h"
#include "tests/gl_test.h"
#include "tests/sim_samples.h"

using namespace samples;

TEST_CASE("a guard that does not trigger changes no bit") {
  GlTest gl;
  // The same kernels with every guard taken out of their text.
  const auto folder = std::filesystem::temp_directory_path() / ("tetpbd_no_guards_" + std::to_string(getpid()));
  std::filesystem::copy(TEST_MODELS "/../shaders", folder, std::filesystem::copy_options::recursive);
  const auto replace = [&](const char* file, const std::string& from, const std::string& to) {
    std::ifstream in(folder / file);
    std::string text{std::istreambuf_iterator<char>(in), {}};
    REQUIRE(text.find(from) != std::string::npos);
    text.replace(text.find(from), from.size(), to);
    std::ofstream(folder / file) << text;
  };
  const auto model = block_model({4, 3, 2}, 0.05);
  for (const char* mode : {"node", "constraint"}) {
    CAPTURE(mode);
    const auto run = [&](bool count) {
      Tuning tuning;
      tuning.count_guards = count;
      Sim sim = create_sim(model, quick(mode, 5), tuning);
      for (int s = 0; s < 40; ++s) step(sim);
      if (count)
        for (std::uint64_t triggered : guard_counts(sim)) CHECK(triggered == 0);
      return state_hash(sim);
    };
    const std::uint64_t hash = run(true);
    CHECK(run(false) == hash);  // nor does counting
    std::filesystem::remove_all(folder);
    std::filesystem::copy(TEST_MODELS "/../shaders", folder, std::filesystem::copy_options::recursive);
    replace("constraints/stretch.glsl", "l > real(1e-6) * rest", "true");
    replace("constraints/bend.glsl", "bool sound = aa > tiny && bb > tiny;", "bool sound = true;");
    replace("constraints/bend.glsl", "clamp(apply_dead_zone(turn, noise), real(-1), real(1))",
            "apply_dead_zone(turn, noise)");
    replace("constraints/volume.glsl", "if (sum <= real(1e-10) * c.floor) {", "if (false) {");
    replace("constraints/types.glsl", "share * max(s.sum, s.least) + a", "share * s.sum + a");
    replace("constraints/types.glsl", "if (beyond) lambda *= max_correction / sqrt(squared);", "");
    replace("constraints/types.glsl", "Multiplier(number ? lambda : real(0), ", "Multiplier(lambda, ");
    set_shader_folder(folder.string());
    const std::uint64_t without = run(false);
    set_shader_folder("");
    // Other drivers may contract other operations of another text.
    if (is_software_renderer()) CHECK(without == hash);
  }
  std::filesystem::remove_all(folder);
}

TEST_CASE("guards that trigger are counted, the same in every run") {
  GlTest gl;
  for (const char* mode : {"node", "constraint", "cpu"})
    for (const auto& [deformation, guard] :
         {std::pair("point", GUARD_DIRECTION), std::pair("point", GUARD_COLLAPSED), std::pair("line", GUARD_COLLAPSED),
          std::pair("line", GUARD_HINGE), std::pair("mirror", GUARD_ANGLE)}) {
      CAPTURE(mode);
      CAPTURE(deformation);
      GuardCounts before{};
      Tuning counting;
      counting.count_guards = true;
      for (int run = 0; run < 2; ++run) {
        Sim sim = create_sim(block_model({3, 2, 2}, 0.0, 1, deformation), quick(mode, 2), counting);
        step(sim);
        const GuardCounts counts = guard_counts(sim);
        for (std::size_t g = 0; g < GUARDS; ++g)
          if (guard == 1u << g &&
              (guard != GUARD_COLLAPSED || std::string(mode) != "cpu"))  // there stretch opens tets first
            CHECK(counts[g] > 0);
        if (run == 1) CHECK(counts == before);
        before = counts;
        reset(sim);
        for (std::uint64_t count : guard_counts(sim)) CHECK(count == 0);
      }
    }
}
