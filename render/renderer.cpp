#include "render/renderer.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "render/layout.h"
#include "sim/layout.h"

namespace tetpbd {

namespace {

using Stages = std::vector<Program::Stage>;

Stages body_stages(const char* geometry, bool shadow) {
  return {{GL_VERTEX_SHADER, "render/body.vert"},
          {GL_GEOMETRY_SHADER, geometry},
          {GL_FRAGMENT_SHADER, shadow ? "render/depth.frag" : "render/body.frag"}};
}

Program body_program(bool tets, bool shadow) {
  return Program(std::string(tets ? "tets" : "surface") + (shadow ? " shadow" : ""),
                 body_stages(tets ? "render/tets.geom" : "render/surface.geom", shadow), {},
                 shadow ? std::vector<std::string>{"SHADOW"} : std::vector<std::string>{});
}

Program screen_program(const std::string& name) {
  return Program(name, {{GL_VERTEX_SHADER, "render/" + name + ".vert"},
                        {GL_FRAGMENT_SHADER, "render/" + name + ".frag"}});
}

const VertexGather* gathered_values(const Renderer& renderer, const ViewOptions& options) {
  if (options.look == Look::tets) return nullptr;  // its geometry shader has the whole tetrahedron
  if (options.colour == Colour::volume) return &renderer.volume_errors;
  if (options.colour == Colour::stretch) return &renderer.stretch_errors;
  return nullptr;
}

bool wants_rest(const Renderer& renderer, const ViewOptions& options) {
  const bool error = options.colour == Colour::volume || options.colour == Colour::stretch;
  return error || options.look == Look::tets || renderer.bodies.size() > 1;
}

Buffer rest_buffer(const Renderer& renderer) {
  std::vector<glm::vec4> rest;
  rest.reserve(renderer.mesh.positions.size());
  for (const glm::dvec3& p : renderer.mesh.positions) rest.emplace_back(glm::vec3(p), 0.0f);
  for (std::size_t body = 0; body < renderer.bodies.size(); ++body)
    for (std::size_t v = renderer.bodies[body].first, end = v + renderer.bodies[body].count;
         v < end && v < rest.size(); ++v)
      rest[v].w = float(body);
  return Buffer("render rest", rest);
}

// Makes what this frame needs and does not have yet.
void prepare(Renderer& renderer, const Frame& frame) {
  const ViewOptions& options = frame.options;
  const bool tets = options.look == Look::tets;
  const auto need = [](auto& thing, auto make) {
    if (!thing) thing = make();
  };
  if (wants_rest(renderer, options)) need(renderer.rest, [&] { return rest_buffer(renderer); });
  if (tets) {
    need(renderer.tets, [&] { return Buffer("tet indices", renderer.mesh.tets); });
    need(renderer.tets_body, [] { return body_program(true, false); });
    if (options.shadow) need(renderer.tets_shadow, [] { return body_program(true, true); });
  } else {
    need(renderer.triangles, [&] { return Buffer("surface indices", renderer.mesh.surface); });
    need(renderer.surface, [] { return body_program(false, false); });
    if (options.shadow) need(renderer.surface_shadow, [] { return body_program(false, true); });
    if (options.smooth_normals) need(renderer.normals, [&] { return make_normals(renderer.mesh); });
    if (options.colour == Colour::volume)
      need(renderer.volume_errors, [&] { return make_volume_errors(renderer.mesh); });
    if (options.colour == Colour::stretch)
      need(renderer.stretch_errors, [&] { return make_stretch_errors(renderer.mesh); });
  }
  if ((options.shadow || (tets && options.explode > 0)) && !renderer.shadow.light)
    make_bounds(renderer.shadow);
  if (options.shadow && !renderer.shadow.depth) make_map(renderer.shadow);
  if (options.backdrop) need(renderer.background, [] { return screen_program("background"); });
  if (frame.ground || !frame.planes.empty()) need(renderer.plane, [] { return screen_program("plane"); });
  if (!frame.pinned.empty() || !frame.grabbed.empty())
    need(renderer.dot, [] { return screen_program("dots"); });
  if ((options.legend && options.colour != Colour::plain) || !frame.caption.empty())
    need(renderer.legend, make_legend);
}

float linear(float srgb) {
  return srgb <= 0.04045f ? srgb / 12.92f : std::pow((srgb + 0.055f) / 1.055f, 2.4f);
}

// Turns the hue about the grey axis (Rodrigues): clay, then teal, ochre, plum and so on, of like lightness.
glm::vec3 turned(const glm::vec3& colour, float degrees) {
  const float c = std::cos(glm::radians(degrees)), s = std::sin(glm::radians(degrees));
  const glm::vec3 grey{0.57735027f};
  const glm::vec3 result =
      colour * c + glm::cross(grey, colour) * s + grey * glm::dot(grey, colour) * (1.0f - c);
  return glm::clamp(result, glm::vec3(0.02f), glm::vec3(1.0f));
}

ColourRange colour_range(const ViewOptions& options) {
  if (options.colour == Colour::stretch) return options.stretch;
  if (options.colour == Colour::velocity) return options.velocity;
  return options.volume;
}

View view_block(const Renderer& renderer, const Frame& frame) {
  const ViewOptions& options = frame.options;
  const Viewport& viewport = frame.viewport;
  View view{};
  const glm::mat4 seen = view_matrix(frame.camera);
  view.camera =
      projection_matrix(frame.camera, float(viewport.width) / float(std::max(viewport.height, 1))) * seen;
  view.eye = glm::vec4(eye(frame.camera), options.smooth_normals && options.look != Look::tets ? 1.0f : 0.0f);
  view.right = glm::vec4(seen[0][0], seen[1][0], seen[2][0], options.shadow ? 1.0f : 0.0f);
  view.pixels = glm::vec4(float(viewport.width), float(viewport.height), 1.0f, 0.0f);
  const ColourRange range = colour_range(options);
  view.colour = glm::vec4(float(options.colour), float(range.low), float(range.high),
                          options.look == Look::wire ? 0.85f : 0.0f);
  view.tets = glm::vec4(float(options.shrink), options.look == Look::tets ? float(options.explode) : 0.0f,
                        float(options.cut), float(options.cut_axis));
  view.rest_low = glm::vec4(renderer.rest_low, 0.0f);
  view.rest_high = glm::vec4(renderer.rest_high, 0.0f);
  const std::array turns{0.0f, 165.0f, 35.0f, 205.0f, -40.0f, 130.0f, 75.0f, 240.0f};
  for (std::size_t i = 0; i < PALETTE_SIZE; ++i) {
    const glm::vec3 c = turned(options.body_colour, turns[i % turns.size()]);
    view.palette[i] =
        glm::vec4(linear(c.x), linear(c.y), linear(c.z), 1.0f) * (i < turns.size() ? 1.0f : 0.8f);
  }
  return view;
}

// The vertex attributes of this frame, or the constants that stand for them.
void bind_attributes(const Renderer& renderer, const Frame& frame) {
  const auto attribute = [](GLuint index, GLuint buffer, GLint count, std::size_t stride,
                            std::size_t offset) {
    if (!buffer) {
      glDisableVertexAttribArray(index);
      glVertexAttrib4f(index, 0, 0, 0, 0);
      return;
    }
    glBindBuffer(GL_ARRAY_BUFFER, buffer);
    glEnableVertexAttribArray(index);
    glVertexAttribPointer(index, count, GL_FLOAT, GL_FALSE, GLsizei(stride),
                          reinterpret_cast<const void*>(offset));
  };
  const ViewOptions& options = frame.options;
  const bool smooth = options.smooth_normals && options.look != Look::tets;
  const VertexGather* values = gathered_values(renderer, options);
  attribute(ATTRIBUTE_HIGH, frame.positions, 3, sizeof(Position), offsetof(Position, high));
  attribute(ATTRIBUTE_LOW, frame.positions, 3, sizeof(Position), offsetof(Position, low));
  attribute(ATTRIBUTE_NORMAL, smooth ? renderer.normals.values.id() : 0, 3, sizeof(glm::vec4), 0);
  attribute(ATTRIBUTE_VALUE, values ? values->values.id() : 0, 1, sizeof(float), 0);
  attribute(ATTRIBUTE_VELOCITY, options.colour == Colour::velocity ? frame.velocities : 0, 3,
            sizeof(Velocity), offsetof(Velocity, high));
  attribute(ATTRIBUTE_REST, wants_rest(renderer, options) ? renderer.rest.id() : 0, 4, sizeof(glm::vec4), 0);
}

void draw_bodies(const Renderer& renderer, const Frame& frame, const Program& program) {
  program.use();
  glBindVertexArray(renderer.vertex_array.id());
  if (frame.options.look == Look::tets) {
    glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, renderer.tets.id());
    glDrawElements(GL_LINES_ADJACENCY, GLsizei(renderer.mesh.tets.size() * 4), GL_UNSIGNED_INT, nullptr);
  } else {
    glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, renderer.triangles.id());
    glDrawElements(GL_TRIANGLES, GLsizei(renderer.mesh.surface.size() * 3), GL_UNSIGNED_INT, nullptr);
  }
}

void draw_shadow_map(const Renderer& renderer, const Frame& frame) {
  glBindFramebuffer(GL_FRAMEBUFFER, renderer.shadow.framebuffer.id());
  glViewport(0, 0, Shadow::size, Shadow::size);
  glDisable(GL_SCISSOR_TEST);
  glDepthMask(GL_TRUE);
  glClear(GL_DEPTH_BUFFER_BIT);
  glEnable(GL_DEPTH_TEST);
  glDepthFunc(GL_LESS);
  glEnable(GL_POLYGON_OFFSET_FILL);
  glPolygonOffset(1.5f, 2.0f);
  draw_bodies(renderer, frame,
              frame.options.look == Look::tets ? renderer.tets_shadow : renderer.surface_shadow);
  glDisable(GL_POLYGON_OFFSET_FILL);
}

void draw_plane(const Renderer& renderer, const Frame& frame, const glm::vec4& plane, bool wall) {
  const bool behind = glm::dot(glm::vec3(plane), eye(frame.camera)) < plane.w;
  const float rest_size = glm::length(renderer.rest_high - renderer.rest_low);
  renderer.plane.use();
  renderer.plane.set("plane", plane);
  renderer.plane.set("centre", frame.camera.target);
  renderer.plane.set("extent",
                     wall ? 2.0f * rest_size : std::max(5.0f * frame.camera.distance, 4.0f * rest_size));
  renderer.plane.set("opacity", (wall ? 0.45f : 1.0f) * (behind ? 0.2f : 1.0f));
  renderer.plane.set("grid", frame.options.grid ? 1.0f : 0.0f);
  // What lies on the plane, or penetrates it a little, shall be neither flickering nor hidden from behind.
  glDepthMask(behind || wall ? GL_FALSE : GL_TRUE);
  glEnable(GL_POLYGON_OFFSET_FILL);
  glPolygonOffset(1.0f, 4.0f);
  glBindVertexArray(renderer.empty_array.id());
  glDrawArrays(GL_TRIANGLE_STRIP, 0, 4);
  glDisable(GL_POLYGON_OFFSET_FILL);
  glDepthMask(GL_TRUE);
}

void draw_dots(Renderer& renderer, const Frame& frame) {
  const std::size_t count = frame.pinned.size() + frame.grabbed.size(), bytes = count * sizeof(std::uint32_t);
  if (renderer.dots.bytes() < bytes) renderer.dots = Buffer("dot indices", bytes, nullptr, GL_STREAM_DRAW);
  std::vector<std::uint32_t> dots = frame.grabbed;  // first, so that it covers its own pin
  dots.insert(dots.end(), frame.pinned.begin(), frame.pinned.end());
  renderer.dots.write(0, bytes, dots.data());
  glBindVertexArray(renderer.vertex_array.id());
  glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, renderer.dots.id());
  glEnable(GL_PROGRAM_POINT_SIZE);
  renderer.dot.use();
  const float scale = std::max(1.0f, float(frame.viewport.height) / 720.0f);
  const auto batch = [&](std::size_t n, std::size_t offset, const glm::vec3& colour, float size) {
    if (!n) return;
    renderer.dot.set("colour", colour);
    renderer.dot.set("size", size * scale);
    glDrawElements(GL_POINTS, GLsizei(n), GL_UNSIGNED_INT, reinterpret_cast<const void*>(offset));
  };
  const std::size_t grabbed = frame.grabbed.size();
  batch(grabbed, 0, glm::vec3(0.90f, 0.32f, 0.02f), 12.0f);
  batch(frame.pinned.size(), grabbed * sizeof(std::uint32_t), glm::vec3(0.020f, 0.035f, 0.060f), 7.0f);
  glDisable(GL_PROGRAM_POINT_SIZE);
}

LegendText legend_text(const ViewOptions& options) {
  const ColourRange range = colour_range(options);
  if (options.colour == Colour::velocity) return {"Speed", "m/s", range.low, range.high, false};
  return {options.colour == Colour::volume ? "Volume error" : "Edge strain", "% of rest", range.low * 100,
          range.high * 100, true};
}

// All values of this frame that come from kernels.
void compute(Renderer& renderer, const Frame& frame) {
  const ViewOptions& options = frame.options;
  if (options.look != Look::tets) {
    if (options.smooth_normals && renderer.normals) update(renderer.normals, frame.positions, renderer.rest);
    if (options.colour == Colour::volume && renderer.volume_errors)
      update(renderer.volume_errors, frame.positions, renderer.rest);
    if (options.colour == Colour::stretch && renderer.stretch_errors)
      update(renderer.stretch_errors, frame.positions, renderer.rest);
  }
  if (options.shadow || (options.look == Look::tets && options.explode > 0)) {
    const float radius =
        std::max(4.0f * frame.camera.distance, 4.0f * glm::length(renderer.rest_high - renderer.rest_low));
    fit(renderer.shadow, frame.positions, renderer.mesh.positions.size(),
        glm::vec4(frame.camera.target, radius));
  }
}

}  // namespace

Renderer make_renderer(TetMesh mesh, std::vector<BodyRange> bodies) {
  Renderer renderer;
  if (!mesh.positions.empty()) renderer.rest_low = renderer.rest_high = glm::vec3(mesh.positions[0]);
  for (const glm::dvec3& p : mesh.positions) {
    renderer.rest_low = glm::min(renderer.rest_low, glm::vec3(p));
    renderer.rest_high = glm::max(renderer.rest_high, glm::vec3(p));
  }
  renderer.mesh = std::move(mesh);
  renderer.bodies = std::move(bodies);
  renderer.vertex_array = VertexArray::make("bodies");
  renderer.empty_array = VertexArray::make("no attributes");
  glBindVertexArray(0);
  renderer.view = Buffer("view", sizeof(View), nullptr, GL_STREAM_DRAW);
  return renderer;
}

Renderer make_renderer(const Model& model) {
  std::vector<BodyRange> bodies;
  for (const Body& body : model.bodies)
    bodies.push_back({std::uint32_t(body.first_vertex), std::uint32_t(body.vertices)});
  return make_renderer(model.rest, std::move(bodies));
}

void draw(Renderer& renderer, const Frame& frame) {
  if (frame.viewport.width < 1 || frame.viewport.height < 1) return;  // a minimised window
  prepare(renderer, frame);
  const ViewOptions& options = frame.options;
  const View view = view_block(renderer, frame);
  renderer.view.write(0, sizeof view, &view);
  renderer.view.bind_uniform(BIND_RENDER_VIEW);
  glDisable(GL_BLEND);
  glDisable(GL_CULL_FACE);
  compute(renderer, frame);
  // Without a light the block is bound all the same, for GL wants some buffer there; its content is not read.
  (renderer.shadow.light ? renderer.shadow.light : renderer.view).bind_uniform(BIND_RENDER_LIGHT);
  glBindVertexArray(renderer.vertex_array.id());
  bind_attributes(renderer, frame);
  glMemoryBarrier(GL_VERTEX_ATTRIB_ARRAY_BARRIER_BIT);  // the step's positions and velocities
  if (options.shadow) draw_shadow_map(renderer, frame);

  const Viewport& viewport = frame.viewport;
  glBindFramebuffer(GL_FRAMEBUFFER, frame.target);
  glViewport(viewport.x, viewport.y, viewport.width, viewport.height);
  glScissor(viewport.x, viewport.y, viewport.width, viewport.height);
  glEnable(GL_SCISSOR_TEST);  // so that clearing leaves a neighbouring viewport alone
  glEnable(GL_FRAMEBUFFER_SRGB);
  glDepthMask(GL_TRUE);
  glClearColor(0.7f, 0.73f, 0.76f, 1.0f);
  glClear(options.backdrop ? GL_DEPTH_BUFFER_BIT : GL_DEPTH_BUFFER_BIT | GL_COLOR_BUFFER_BIT);
  glDisable(GL_DEPTH_TEST);
  glBindVertexArray(renderer.empty_array.id());
  if (options.backdrop) {
    renderer.background.use();
    glDrawArrays(GL_TRIANGLES, 0, 3);
  }

  for (const auto& [unit, sampler] :
       {std::pair{UNIT_SHADOW, &renderer.shadow.compared}, {UNIT_SHADOW_DEPTH, &renderer.shadow.plain}}) {
    glActiveTexture(GL_TEXTURE0 + GLenum(unit));
    glBindTexture(GL_TEXTURE_2D, options.shadow ? renderer.shadow.depth.id() : 0);
    glBindSampler(GLuint(unit), options.shadow ? sampler->id() : 0);
  }
  glActiveTexture(GL_TEXTURE0);
  glEnable(GL_DEPTH_TEST);
  glDepthFunc(GL_LESS);
  glEnable(GL_BLEND);
  glBlendFuncSeparate(GL_SRC_ALPHA, GL_ONE_MINUS_SRC_ALPHA, GL_ONE, GL_ONE);
  if (options.backdrop) {
    if (frame.ground) draw_plane(renderer, frame, glm::vec4(0.0f, 1.0f, 0.0f, *frame.ground), false);
    for (const glm::vec4& plane : frame.planes) draw_plane(renderer, frame, plane, true);
  }
  glDisable(GL_BLEND);
  draw_bodies(renderer, frame, options.look == Look::tets ? renderer.tets_body : renderer.surface);
  glEnable(GL_BLEND);
  if (!frame.pinned.empty() || !frame.grabbed.empty()) draw_dots(renderer, frame);
  glDisable(GL_DEPTH_TEST);
  const bool scale = options.legend && options.colour != Colour::plain;
  if (scale || !frame.caption.empty()) {
    const LegendText text = legend_text(options);
    draw_legend(*renderer.legend, viewport.width, viewport.height, scale ? &text : nullptr, frame.caption);
  }
  glDisable(GL_BLEND);
  glDisable(GL_FRAMEBUFFER_SRGB);
  glDisable(GL_SCISSOR_TEST);
  for (int unit : {UNIT_SHADOW, UNIT_SHADOW_DEPTH}) glBindSampler(GLuint(unit), 0);
  glBindVertexArray(0);
  glUseProgram(0);
}

void reload_shaders(Renderer& renderer) {
  std::vector<std::pair<Program*, Program>> fresh;
  const auto again = [&](Program& program, auto make) {
    if (program) fresh.emplace_back(&program, make());
  };
  again(renderer.surface, [] { return body_program(false, false); });
  again(renderer.surface_shadow, [] { return body_program(false, true); });
  again(renderer.tets_body, [] { return body_program(true, false); });
  again(renderer.tets_shadow, [] { return body_program(true, true); });
  again(renderer.background, [] { return screen_program("background"); });
  again(renderer.plane, [] { return screen_program("plane"); });
  again(renderer.dot, [] { return screen_program("dots"); });
  again(renderer.normals.kernel, [] { return Program::compute("render/normals.comp"); });
  again(renderer.volume_errors.kernel,
        [] { return Program::compute("render/vertex_error.comp", {}, {"VOLUME"}); });
  again(renderer.stretch_errors.kernel, [] { return Program::compute("render/vertex_error.comp"); });
  again(renderer.shadow.bounds_kernel, [] { return Program::compute("render/bounds.comp"); });
  again(renderer.shadow.fit_kernel, [] { return Program::compute("render/shadow_fit.comp"); });
  if (renderer.legend) again(renderer.legend->program, [] { return screen_program("legend"); });
  for (auto& [program, compiled] : fresh) *program = std::move(compiled);
}

}  // namespace tetpbd
