#include "render/picking.h"

#include <array>
#include <bit>

#include "render/layout.h"
#include "sim/gl/layout.h"

namespace tetpbd {

namespace {

constexpr std::uint32_t none = ~0u;

void start(Picker& picker, Pass& pass, GLuint positions, const Buffer& elements, std::size_t count, const Ray& ray) {
  picker.ray = ray;
  const std::array nothing{none, none, none};
  picker.result.write(0, sizeof nothing, nothing.data());
  Recorder& recorder = picker.recorder;
  recorder.begin();
  const Program& kernel = recorder.use(pass.program);
  kernel.set("count", unsigned(count));
  kernel.set("origin", ray.origin);
  kernel.set("direction", ray.direction);
  recorder.give("Positions", positions), recorder.give("Triangles", elements);
  recorder.give("Result", picker.result);
  recorder.barrier(GL_SHADER_STORAGE_BARRIER_BIT);  // the step's positions
  for (int stage = 0; stage < 3; ++stage) {
    kernel.set("stage", stage);
    pass.work_groups = stage < 2 ? work_groups(count, 128) : 1;
    recorder.run(pass);
  }
  picker.requested = Fence::here();
}

}  // namespace

Picker make_picker(const TetMesh& mesh) {
  Picker picker;
  picker.kernel = {Program::compute("render/pick.comp")};
  picker.triangles = Buffer("pick triangles", mesh.surface);
  picker.result = Buffer("pick result", 3 * sizeof(std::uint32_t), nullptr, GL_STREAM_READ);
  return picker;
}

void request(Picker& picker, GLuint positions, const Ray& ray) {
  picker.inside = false;
  start(picker, picker.kernel, positions, picker.triangles, picker.triangles.bytes() / sizeof(Triangle), ray);
}

void request(Picker& picker, Renderer& renderer, const Frame& frame, const Ray& ray) {
  picker.inside = frame.options.look == Look::tets || frame.options.is_cut();
  const Buffer& triangles = renderer.shown_triangles ? renderer.shown_triangles : picker.triangles;
  if (!picker.inside)
    return start(picker, picker.kernel, frame.positions, triangles, triangles.bytes() / sizeof(Triangle), ray);
  if (!picker.tets_kernel) picker.tets_kernel = {Program::compute("render/pick.comp", {}, {"TETS"})};
  bind_view(renderer, frame);
  picker.recorder.give("Rest", rest_buffer(renderer));
  start(picker, picker.tets_kernel, frame.positions, shown_tet_buffer(renderer), renderer.mesh.tets.size(), ray);
}

std::optional<Pick> poll(Picker& picker, bool wait) {
  const auto result = poll_readback<std::uint32_t>(picker.requested, picker.result, "picking", wait);
  if (!result) return std::nullopt;
  const std::uint32_t element = result->at(1), vertex = result->at(2);
  if (element == none) return Pick{.ray = picker.ray};
  return Pick{true, picker.inside, element, vertex, std::bit_cast<float>(result->at(0)), picker.ray};
}

}  // namespace tetpbd
