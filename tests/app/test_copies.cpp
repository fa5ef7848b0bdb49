// Copies of a scene's bodies, which share dispatches and nothing else.
#include <doctest/doctest.h>

#include "app/scene.h"
#include "sim/error.h"
#include "sim/sim.h"
#include "tests/gl_test.h"

using namespace tetpbd;

namespace {

SceneOverrides small(const char* mode, int copies) {
  SceneOverrides overrides{.set = {"bodies.0.block.cells=[6,2,2]"}, .copies = copies};
  overrides.parameters = {{"mode", mode}};
  return overrides;
}

State end_of(const Scene& scene, int steps) {
  Sim sim = create_sim(build_model(scene), scene.settings);
  for (int s = 0; s < steps; ++s) step(sim);
  REQUIRE_FALSE(check_finite(sim, true));
  return read_state(sim);
}

}  // namespace

TEST_CASE("copies: each moves as the scene alone does") {
  GlTest gl;
  constexpr int copies = 5, steps = 40;
  for (const char* mode : {"node", "constraint", "explicit", "newton", "cpu", "cpu-fast"}) {
    CAPTURE(mode);
    const Scene one = load_scene("soft-beam", small(mode, 1)), many = load_scene("soft-beam", small(mode, copies));
    REQUIRE(many.bodies.size() == copies);
    CHECK(many.bodies[2].name == one.bodies[0].name + " 3");
    const State alone = end_of(one, steps), all = end_of(many, steps);
    const std::size_t count = alone.positions.size();
    REQUIRE(all.positions.size() == copies * count);
    double farthest = 0, moved = 0;
    const auto start = build_model(one)->positions;
    for (std::size_t v = 0; v < all.positions.size(); ++v) {
      farthest = std::max(farthest, glm::distance(all.positions[v], alone.positions[v % count]));
      moved = std::max(moved, glm::distance(start[v % count], alone.positions[v % count]));
    }
    CHECK(moved > 0.05);
    // Sums of newton's conjugate gradients go over all copies, so that these end where one alone would not yet.
    CHECK(farthest < (mode == std::string("newton") ? 5e-3 * moved : 1e-6 * moved));
    MESSAGE(std::string(mode), ": ", farthest / moved, " of the way");
  }
}

TEST_CASE("copies: attachments, forces and materials are of each copy (long)") {
  GlTest gl;
  const SceneOverrides none{.parameters = {{"contact", "none"}}};
  SceneOverrides three = none;
  three.copies = 3;
  const Scene one = load_scene("muscle-arm", none), many = load_scene("muscle-arm", three);
  REQUIRE(many.bodies.size() == 3 * one.bodies.size());
  CHECK(many.attachments.size() == 3 * one.attachments.size());
  CHECK(many.settings.bodies.size() == 3 * one.settings.bodies.size());
  const auto model = build_model(many);
  for (const Attachment& attachment : model->attachments)
    CHECK(attachment.body / one.bodies.size() == attachment.to / one.bodies.size());
  const State alone = end_of(one, 5), all = end_of(many, 5);
  for (std::size_t v = 0; v < all.positions.size(); ++v)
    CHECK(glm::distance(all.positions[v], alone.positions[v % alone.positions.size()]) < 1e-4);
}

TEST_CASE("copies: those that would touch, or that memory cannot hold, are refused") {
  CHECK_THROWS_WITH_AS(load_scene("stack", {.copies = 2}), doctest::Contains("--contact none"), Error);
  CHECK_THROWS_WITH_AS(load_scene("soft-beam", {.parameters = {{"contact", "self"}}, .copies = 2}),
                       doctest::Contains("would touch each other"), Error);
  CHECK_THROWS_WITH_AS(build_model(load_scene("soft-beam", {.copies = 3000})), doctest::Contains("bytes"), Error);
  try {
    build_model(load_scene("soft-beam", {.copies = 3000}));
  } catch (const Error& error) {
    CHECK(std::string(error.what()).find("take at most") != std::string::npos);
  }
}
