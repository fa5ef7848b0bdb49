// Programs and buffers as objects that somebody owns.
#include <algorithm>

#include "sim/gl/gpu.h"
#include "sim/layout.h"
#include "tests/gl_test.h"

using namespace tetpbd;

namespace {

// What the kernel leaves of 1, 2, 3.
std::vector<unsigned> run_copy(const Program& program) {
  const std::vector<unsigned> numbers = {1, 2, 3};
  const Buffer from("from", numbers), to("to", 12), check("check", std::vector<unsigned>{~0u, ~0u});
  from.bind_storage(BIND_CHECKPOINT_FROM), to.bind_storage(BIND_CHECKPOINT_TO),
      check.bind_storage(BIND_CHECK);
  program.use();
  program.set("count", 3u);
  glDispatchCompute(1, 1, 1);
  return to.read_all<unsigned>();
}

const std::vector<unsigned> copied = {1, 2, 3};

}  // namespace

TEST_CASE("a program keeps its own uniforms, whatever another of the same text is given") {
  GlTest gl;
  const Program one = Program::compute("checkpoint.comp"), other = Program::compute("checkpoint.comp");
  other.use();
  other.set("count", 1u);
  CHECK(run_copy(one) == copied);
  CHECK(one.id() != other.id());
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
