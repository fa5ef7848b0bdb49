// Programs and buffers as objects that somebody owns.
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "sim/gl/pass.h"
#include "tests/gl_test.h"

using namespace tetpbd;

namespace {

// What the kernel leaves of 1, 2, 3.
std::vector<unsigned> run_copy(Program program) {
  const std::vector<unsigned> numbers = {1, 2, 3};
  const Buffer from("from", numbers), to("to", 12), check("check", std::vector<unsigned>{~0u, ~0u});
  Recorder recorder;
  recorder.give("From", from), recorder.give("To", to), recorder.give("Check", check);
  Pass pass{std::move(program), 1};
  recorder.use(pass.program).set("count", 3u);
  recorder.run(pass);
  return to.read_all<unsigned>();
}

const std::vector<unsigned> copied = {1, 2, 3};

}  // namespace

TEST_CASE("a program keeps its own uniforms, whatever another of the same text is given") {
  GlTest gl;
  Program one = Program::compute("checkpoint.comp"), other = Program::compute("checkpoint.comp");
  other.use();
  other.set("count", 1u);
  CHECK(one.id() != other.id());
  CHECK(run_copy(std::move(one)) == copied);
}

TEST_CASE("GL objects are counted while they live") {
  GlTest gl;
  const GlLive before = gl_live();
  {
    Buffer moved("a", 400), buffer = std::move(moved);
    Program program = Program::compute("checkpoint.comp");
    const Fence fence = Fence::here();
    buffer = Buffer("b", 1000);
    CHECK(buffer.bytes() == 1000);
    CHECK(gl_live().objects == before.objects + 3);
    CHECK(gl_live().buffer_bytes == before.buffer_bytes + 1000);
  }
  CHECK(gl_live().objects == before.objects);
  CHECK(gl_live().buffer_bytes == before.buffer_bytes);
}

TEST_CASE(
    "a kernel with more storage blocks than GL 4.3 guarantees is refused, one without its buffer does not "
    "run") {
  GlTest gl;
  const auto folder = std::filesystem::temp_directory_path() / ("tetpbd_blocks_" + std::to_string(getpid()));
  std::filesystem::create_directories(folder);
  const auto kernel = [&](int blocks) {
    std::string text = "layout(local_size_x = 1) in;\n", sum = "0u";
    for (int b = 0; b < blocks; ++b) {
      text += "layout(std430) buffer Block" + std::to_string(b) + " { uint values" + std::to_string(b) + "[]; };\n";
      if (b > 0) sum += " + values" + std::to_string(b) + "[0]";
    }
    std::ofstream(folder / "sum.comp") << text << "void main() { values0[0] = " << sum << "; }\n";
    set_shader_folder(folder.string());
    Pass pass;
    try {
      pass = {Program::compute("sum.comp"), 1};
    } catch (...) {
      set_shader_folder("");
      throw;
    }
    set_shader_folder("");
    return pass;
  };
  CHECK_THROWS_WITH_AS(kernel(9), doctest::Contains("9 of at most 8: "), Error);
  Pass pass = kernel(8);
  Recorder recorder;
  std::vector<Buffer> buffers;
  for (unsigned b = 0; b < 8; ++b) buffers.emplace_back("block", std::vector<unsigned>{1u << b});
  for (unsigned b = 0; b < 7; ++b) recorder.give("Block" + std::to_string(b), buffers[b]);
  CHECK_THROWS_WITH_AS(recorder.run(pass), doctest::Contains("'Block7' of sum"), Error);
  recorder.give("Block7", buffers[7]);
  recorder.counting = true;
  recorder.run(pass), recorder.run(pass);
  CHECK(buffers[0].read_all<unsigned>()[0] == 254);
  REQUIRE(recorder.counted.size() == 1);
  CHECK(recorder.counted[0].dispatches == 2);
  recorder.give("Block1", buffers[7]);  // another buffer by the same name
  recorder.run(pass);
  CHECK(buffers[0].read_all<unsigned>()[0] == 254 - 2 + 128);
  std::filesystem::remove_all(folder);
}
