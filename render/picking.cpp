#include "render/picking.h"

#include <array>
#include <bit>

#include "render/layout.h"
#include "sim/layout.h"

namespace tetpbd {

namespace {
constexpr std::uint32_t none = ~0u;
}

Picker make_picker(const TetMesh& mesh) {
  Picker picker;
  picker.kernel = Program::compute("render/pick.comp");
  picker.triangles = Buffer("pick triangles", mesh.surface);
  picker.result = Buffer("pick result", 3 * sizeof(std::uint32_t), nullptr, GL_STREAM_READ);
  return picker;
}

void request(Picker& picker, GLuint positions, const Ray& ray) {
  picker.ray = ray;
  const std::array<std::uint32_t, 3> start{none, none, none};
  picker.result.write(0, sizeof start, start.data());
  const std::size_t count = picker.triangles.bytes() / sizeof(Triangle);
  picker.kernel.use();
  picker.kernel.set("count", unsigned(count));
  picker.kernel.set("origin", ray.origin);
  picker.kernel.set("direction", ray.direction);
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, BIND_RENDER_POSITIONS, positions);
  picker.triangles.bind_storage(BIND_PICK_TRIANGLES);
  picker.result.bind_storage(BIND_PICK_RESULT);
  for (int stage = 0; stage < 3; ++stage) {
    picker.kernel.set("stage", stage);
    glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT);  // the step's positions, then the stage before
    glDispatchCompute(stage < 2 ? unsigned(work_groups(count, 128)) : 1, 1, 1);
  }
  picker.answered = Fence::here();
}

std::optional<Pick> poll(Picker& picker, bool wait) {
  const auto answer = take<std::uint32_t>(picker.answered, picker.result, "picking", wait);
  if (!answer) return std::nullopt;
  const std::uint32_t triangle = answer->at(1), vertex = answer->at(2);
  if (triangle == none) return Pick{.ray = picker.ray};
  return Pick{true, triangle, vertex, std::bit_cast<float>(answer->at(0)), picker.ray};
}

}  // namespace tetpbd
