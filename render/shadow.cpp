// The key light: its projection, its depth image, and the light that arrives on planes.
#include <cstddef>
#include <tuple>
#include <utility>

#include "render/layout.h"
#include "render/parts.h"

namespace tetpbd {

namespace {

// Obstacles farther from the bodies than this, in their size, play no part in the light.
constexpr float obstacle_reach = 3;

void make_map(Shadow& shadow) {
  Texture depth("shadow depth");
  clear_errors();
  glTexImage2D(GL_TEXTURE_2D, 0, GL_DEPTH_COMPONENT32F, shadow.size, shadow.size, 0, GL_DEPTH_COMPONENT, GL_FLOAT,
               nullptr);
  shadow.depth_size = shadow.size;
  check_memory("the shadow map", std::size_t(shadow.size) * std::size_t(shadow.size) * 4);
  shadow.depth = std::move(depth);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAX_LEVEL, 0);
  shadow.framebuffer = Framebuffer("shadow");
  glFramebufferTexture2D(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_TEXTURE_2D, shadow.depth.id(), 0);
  glDrawBuffer(GL_NONE);
  glReadBuffer(GL_NONE);
  const std::array<float, 4> lit{1.0f, 1.0f, 1.0f, 1.0f};
  shadow.compared = Sampler("shadow compared");
  shadow.plain = Sampler("shadow plain");
  for (const auto& [sampler, filter] : {std::pair{shadow.compared.id(), GL_LINEAR}, {shadow.plain.id(), GL_NEAREST}}) {
    for (GLenum wrap : {GL_TEXTURE_WRAP_S, GL_TEXTURE_WRAP_T}) glSamplerParameteri(sampler, wrap, GL_CLAMP_TO_BORDER);
    for (GLenum size : {GL_TEXTURE_MIN_FILTER, GL_TEXTURE_MAG_FILTER}) glSamplerParameteri(sampler, size, filter);
    glSamplerParameterfv(sampler, GL_TEXTURE_BORDER_COLOR, lit.data());
  }
  glSamplerParameteri(shadow.compared.id(), GL_TEXTURE_COMPARE_MODE, GL_COMPARE_REF_TO_TEXTURE);
  glSamplerParameteri(shadow.compared.id(), GL_TEXTURE_COMPARE_FUNC, GL_LEQUAL);
}

}  // namespace

void fit_light(Renderer& renderer, const Frame& frame) {
  const ViewOptions& options = frame.options;
  if (!options.shadow && !options.follow && !(options.look == Look::tets && options.explode > 0)) return;
  Shadow& shadow = renderer.shadow;
  if (!shadow.light) {
    shadow.bounds = Buffer("bounds", std::vector<std::uint32_t>{~0u, ~0u, ~0u, 0, 0, 0, 0});
    shadow.light = Buffer("light", sizeof(Light));
    shadow.centre = Buffer("centre", sizeof(glm::vec4), nullptr, GL_STREAM_READ);
  }
  const std::size_t count = renderer.mesh.positions.size();
  const float rest_size = glm::length(renderer.rest_high - renderer.rest_low);
  shadow.size = has_surfaces(frame) ? 1536 : 512;  // obstacles are larger than bodies
  Pass& pass = kernel(renderer, "shadow fit");
  const Program& program = pass.program;
  program.set("map_size", float(shadow.size));
  const Bounds nothing{glm::dvec3(1e30), glm::dvec3(-1e30)};
  const Bounds obstacles = frame.model ? with_obstacles(nothing, *frame.model, frame.time, INFINITY) : nothing;
  program.set("obstacles_low", glm::vec3(obstacles.low));
  program.set("obstacles_high", glm::vec3(obstacles.high));
  program.set("reach", obstacle_reach * rest_size);
  // The centre and radius of the region that the map may cover, so that one vertex far away does not spoil it.
  program.set("limit", glm::vec4(frame.camera.target, 4.0f * std::max(frame.camera.distance, rest_size)));
  Recorder& recorder = renderer.recorder;
  recorder.give("Positions", frame.positions);
  recorder.give("Bounds", shadow.bounds), recorder.give("Fit", shadow.light);
  run_over(renderer, pass, count);
  recorder.barrier(GL_UNIFORM_BARRIER_BIT | GL_BUFFER_UPDATE_BARRIER_BIT);
  if (!options.follow || shadow.centre_copied) return;
  shadow.light.copy_to(shadow.centre, 0, offsetof(Light, centre), sizeof(glm::vec4));
  shadow.centre_copied = Fence::here();
}

void draw_shadow_map(Renderer& renderer, const Frame& frame, GLuint values) {
  if (renderer.shadow.depth_size != renderer.shadow.size) make_map(renderer.shadow);
  glBindFramebuffer(GL_FRAMEBUFFER, renderer.shadow.framebuffer.id());
  glViewport(0, 0, renderer.shadow.size, renderer.shadow.size);
  glDisable(GL_SCISSOR_TEST);
  glDepthMask(GL_TRUE);
  glClear(GL_DEPTH_BUFFER_BIT);
  glEnable(GL_DEPTH_TEST);
  glDepthFunc(GL_LESS);
  glEnable(GL_POLYGON_OFFSET_FILL);
  glPolygonOffset(1.5f, 2.0f);
  draw_bodies(renderer, frame, values, true);
  glEnable(GL_DEPTH_CLAMP);  // obstacles may reach farther than the map
  draw_obstacles(renderer, frame, true);
  glDisable(GL_DEPTH_CLAMP);
  glDisable(GL_POLYGON_OFFSET_FILL);
}

void bind_shadows(const Shadow& shadow) {
  const std::tuple<int, GLuint, GLuint> units[] = {{UNIT_SHADOW, shadow.depth.id(), shadow.compared.id()},
                                                   {UNIT_SHADOW_DEPTH, shadow.depth.id(), shadow.plain.id()},
                                                   {UNIT_PLANES, shadow.planes.id(), 0}};
  for (const auto& [unit, texture, sampler] : units) {
    glActiveTexture(GL_TEXTURE0 + GLenum(unit));
    glBindTexture(GL_TEXTURE_2D, texture);
    glBindSampler(GLuint(unit), sampler);
  }
  glActiveTexture(GL_TEXTURE0);
}

void light_planes(Renderer& renderer, const Frame& frame, int count) {
  Shadow& shadow = renderer.shadow;
  const int part = has_surfaces(frame) ? 16 : 32;
  const int size = std::clamp(frame.viewport.height / part * 16, 128, 512);  // whole work-groups
  if (shadow.planes_size != size || shadow.planes_count != count) {
    shadow.planes = Texture("light on planes");
    clear_errors();
    glTexImage2D(GL_TEXTURE_2D, 0, GL_RG8, size * count, size, 0, GL_RG, GL_UNSIGNED_BYTE, nullptr);
    check_memory("the light on planes", std::size_t(size) * std::size_t(size * count) * 2);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAX_LEVEL, 0);
    for (GLenum wrap : {GL_TEXTURE_WRAP_S, GL_TEXTURE_WRAP_T}) glTexParameteri(GL_TEXTURE_2D, wrap, GL_CLAMP_TO_EDGE);
    shadow.planes_size = size, shadow.planes_count = count;
  }
  bind_shadows(shadow);
  Pass& pass = kernel(renderer, "plane light");
  pass.program.set("triangles", unsigned(renderer.mesh.surface.size()));
  pass.program.set("map_size", size);
  renderer.recorder.give("Corners", renderer.corners.values);
  glBindImageTexture(IMAGE_PLANES, shadow.planes.id(), 0, GL_FALSE, 0, GL_WRITE_ONLY, GL_RG8);
  pass.grid = glm::uvec3(size / 16, size / 16, count);
  renderer.recorder.run(pass);
  renderer.recorder.barrier(GL_TEXTURE_FETCH_BARRIER_BIT);
}

std::optional<glm::vec3> poll_centre(Renderer& renderer, bool wait) {
  Shadow& shadow = renderer.shadow;
  const auto centre = poll_readback<glm::vec4>(shadow.centre_copied, shadow.centre, "reading the bodies' middle", wait);
  return centre ? std::optional(glm::vec3(centre->front())) : std::nullopt;
}

}  // namespace tetpbd
