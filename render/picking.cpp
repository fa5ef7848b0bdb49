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

namespace {

void ask(Picker& picker, const Program& kernel, GLuint positions, const Buffer& elements, std::size_t count,
         const Ray& ray) {
  picker.ray = ray;
  const std::array<std::uint32_t, 3> start{none, none, none};
  picker.result.write(0, sizeof start, start.data());
  kernel.use();
  kernel.set("count", unsigned(count));
  kernel.set("origin", ray.origin);
  kernel.set("direction", ray.direction);
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, BIND_RENDER_POSITIONS, positions);
  elements.bind_storage(BIND_PICK_TRIANGLES);
  picker.result.bind_storage(BIND_PICK_RESULT);
  for (int stage = 0; stage < 3; ++stage) {
    kernel.set("stage", stage);
    glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT);  // the step's positions, then the stage before
    glDispatchCompute(stage < 2 ? unsigned(work_groups(count, 128)) : 1, 1, 1);
  }
  picker.answered = Fence::here();
}

}  // namespace

void request(Picker& picker, GLuint positions, const Ray& ray) {
  picker.inside = false;
  ask(picker, picker.kernel, positions, picker.triangles, picker.triangles.bytes() / sizeof(Triangle), ray);
}

void request(Picker& picker, Renderer& renderer, const Frame& frame, const Ray& ray) {
  picker.inside = frame.options.look == Look::tets || frame.options.is_cut();
  if (!picker.inside) return request(picker, frame.positions, ray);
  if (!picker.tets_kernel) picker.tets_kernel = Program::compute("render/pick.comp", {}, {"TETS"});
  bind_view(renderer, frame);
  rest_of(renderer).bind_storage(BIND_PICK_REST);
  ask(picker, picker.tets_kernel, frame.positions, tets_of(renderer), renderer.mesh.tets.size(), ray);
}

std::optional<Pick> poll(Picker& picker, bool wait) {
  const auto answer = take<std::uint32_t>(picker.answered, picker.result, "picking", wait);
  if (!answer) return std::nullopt;
  const std::uint32_t element = answer->at(1), vertex = answer->at(2);
  if (element == none) return Pick{.ray = picker.ray};
  return Pick{true, picker.inside, element, vertex, std::bit_cast<float>(answer->at(0)), picker.ray};
}

}  // namespace tetpbd
