#include "render/renderer.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <glm/gtc/color_space.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <iterator>
#include <ranges>
#include <tuple>
#include <utility>

#include "render/carried.h"
#include "render/layout.h"
#include "render/marks.h"
#include "sim/contact/moving_obstacle.h"
#include "sim/layout.h"
#include "sim/material.h"
#include "sim/parallel.h"

namespace tetpbd {

namespace {

/// Shader files, and what they define.
struct Recipe {
  std::vector<std::string> files, defines;
};

const std::map<std::string, Recipe> recipes = {
    {"surface", {{"render/surface.vert", "render/body.frag"}, {}}},
    {"surface shadow", {{"render/surface.vert", "render/depth.frag"}, {"SHADOW"}}},
    {"carried", {{"render/carried.vert", "render/body.frag"}, {}}},
    {"carried shadow", {{"render/carried.vert", "render/depth.frag"}, {"SHADOW"}}},
    {"cofactors", {{"render/cofactors.comp"}, {}}},
    {"tets", {{"render/body.vert", "render/tets.geom", "render/body.frag"}, {}}},
    {"tets shadow", {{"render/body.vert", "render/tets.geom", "render/depth.frag"}, {"SHADOW"}}},
    {"caps", {{"render/body.vert", "render/caps.geom", "render/body.frag"}, {}}},
    {"caps shadow", {{"render/body.vert", "render/caps.geom", "render/depth.frag"}, {"SHADOW"}}},
    {"background", {{"render/background.vert", "render/background.frag"}, {}}},
    {"plane", {{"render/plane.vert", "render/plane.frag"}, {}}},
    {"obstacles", {{"render/obstacle.vert", "render/body.frag"}, {"SHAPE"}}},
    {"obstacles shadow", {{"render/obstacle.vert", "render/depth.frag"}, {"SHADOW"}}},
    {"graph", {{"render/body.vert", "render/graph.geom", "render/graph.frag"}, {}}},
    {"contacts", {{"render/dots.vert", "render/dots.frag"}, {"CONTACTS"}}},
    {"contact arrows", {{"render/arrows.vert", "render/arrows.geom", "render/arrows.frag"}, {"CONTACTS"}}},
    {"arrows", {{"render/arrows.vert", "render/arrows.geom", "render/arrows.frag"}, {}}},
    {"dots", {{"render/dots.vert", "render/dots.frag"}, {}}},
    {"corners", {{"render/corners.comp"}, {}}},
    {"plane light", {{"render/plane_light.comp"}, {}}},
    {"tet values", {{"render/gather.comp"}, {"TETS"}}},
    {"edge strains", {{"render/gather.comp"}, {}}},
    {"speeds", {{"render/vertex_values.comp"}, {"SPEED"}}},
    {"distances", {{"render/vertex_values.comp"}, {}}},
    {"shadow fit", {{"render/shadow_fit.comp"}, {}}}};

Program compile(const std::string& name) {
  const auto& [files, defines] = recipes.at(name);
  return Program(name, files, {}, defines);
}

// What the corners of elements gather: the other corners of each, in the order of `others`.
template <std::size_t N>
VertexGather gather(const TetMesh& mesh, const std::vector<std::array<std::uint32_t, N>>& elements,
                    const std::array<std::array<std::size_t, N - 1>, N>& others, const std::string& label,
                    std::size_t bytes) {
  const auto corners = [&](std::size_t e, const auto& emit) {
    for (std::size_t k = 0; k < N; ++k) emit(elements[e][k], std::uint32_t(e * N + k));
  };
  const Grouped grouped = group_by_key(elements.size(), mesh.positions.size(), corners);
  std::vector<std::uint32_t> items;
  for (const std::uint32_t corner : grouped.values)
    for (const std::size_t other : others[corner % N]) items.push_back(elements[corner / N][other]);
  return {Buffer(label + " offsets", grouped.first), Buffer(label + " items", items), Buffer(label, bytes)};
}

// Dispatches a kernel over all vertices; `values` by vertex. What it reads is behind a barrier.
void fill(Renderer& renderer, Pass& pass, GLuint positions, const Buffer& values) {
  renderer.recorder.give("Positions", positions);
  renderer.recorder.give("Rest", renderer.rest);  // not all need it
  renderer.recorder.give("Values", values);
  run_over(renderer, pass, renderer.mesh.positions.size());
}

// The other corners of a tet, by corner; even permutations, which keep the sign of the volume.
constexpr std::array<std::array<std::size_t, 3>, 4> even{{{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}}};

// The name of the buffer of values, made when first asked for and filled by their program.
GLuint gathered(Renderer& renderer, const Frame& frame, VertexGather& values, Pass& pass, const auto& make) {
  if (!values) values = make(renderer.mesh);
  renderer.recorder.give("Offsets", values.offsets), renderer.recorder.give("Items", values.items);
  fill(renderer, pass, frame.positions, values.values);
  return values.values.id();
}

// Of the frame's colour; 0 where there are none.
GLuint vertex_values(Renderer& renderer, const Frame& frame) {
  const Colour colour = frame.options.colour;
  if (colour == Colour::plain) return 0;
  if (colour == Colour::motion || colour == Colour::patch) return frame.values;
  rest_of(renderer);
  VertexGather& values = renderer.values[colour];
  const std::size_t bytes = renderer.mesh.positions.size() * sizeof(float);
  const std::string label = std::string("vertex values, ") + colour_names[std::size_t(colour)];
  if (colour == Colour::velocity) {
    if (!values) values.values = Buffer(label, bytes);
    renderer.recorder.give("Velocities", frame.velocities);
    fill(renderer, kernel(renderer, "speeds"), frame.positions, values.values);
    return values.values.id();
  }
  if (colour == Colour::stretch)
    return gathered(renderer, frame, values, kernel(renderer, "edge strains"), [&](const TetMesh& mesh) {
      return gather<2>(mesh, tet_edges(mesh), {{{1}, {0}}}, label, bytes);
    });
  Pass& pass = kernel(renderer, "tet values");
  pass.program.set("kind", int(colour));
  pass.program.set("material", frame.material);
  return gathered(renderer, frame, values, pass,
                  [&](const TetMesh& mesh) { return gather<4>(mesh, mesh.tets, even, label, bytes); });
}

// What a fine surface needs beside the positions.
void fill_cofactors(Renderer& renderer, const Frame& frame) {
  if (!renderer.carried_array) make_carried(renderer);
  rest_of(renderer), tets_of(renderer);
  gathered(renderer, frame, renderer.cofactors, kernel(renderer, "cofactors"), [](const TetMesh& mesh) {
    return gather<4>(mesh, mesh.tets, even, "cofactors", mesh.positions.size() * 3 * sizeof(glm::vec4));
  });
}

// Turns the hue about the grey axis: clay, then teal, ochre, plum and so on, of like lightness.
glm::vec3 turned(const glm::vec3& colour, float degrees) {
  const glm::mat3 turn(glm::rotate(glm::mat4(1.0f), glm::radians(degrees), glm::vec3(1.0f)));
  return glm::clamp(turn * colour, 0.02f, 1.0f);
}

// n.x <= w of what is shown of the rest shape.
glm::vec4 cut_plane(const Renderer& renderer, const ViewOptions& options) {
  const glm::vec3 n = options.cut_direction(), middle = 0.5f * (renderer.rest_low + renderer.rest_high);
  const float half = glm::dot(glm::abs(n), 0.5f * (renderer.rest_high - renderer.rest_low));
  return glm::vec4(n, options.is_cut() ? glm::dot(n, middle) + half * float(2 * options.cut - 1) : 1e30f);
}

// Farther from the bodies, in their size, obstacles play no part in the light.
constexpr float obstacle_reach = 3;

View view_block(const Renderer& renderer, const Frame& frame) {
  const ViewOptions& options = frame.options;
  View view{};
  const glm::mat4 seen = view_matrix(frame.camera);
  view.camera =
      projection_matrix(frame.camera, float(frame.viewport.width) / float(frame.viewport.height)) * seen;
  // 55 degrees: the shipped meshes have folds of 50 that ought to look round, and would show as saw teeth.
  view.eye = glm::vec4(eye(frame.camera), options.smooth_normals ? 0.574f : 2.0f);
  view.right = glm::vec4(seen[0][0], seen[1][0], seen[2][0], options.shadow ? 1.0f : 0.0f);
  view.colour = glm::vec4(float(options.colour), float(options.range().low), float(options.range().high),
                          options.look == Look::wire ? 0.8f : 0.0f);
  const bool tets = options.look == Look::tets;
  view.tets = tets ? glm::vec4(options.shrink, options.explode, 1, 0) : glm::vec4(0);
  view.cut = cut_plane(renderer, options);
  view.material = glm::vec4(glm::vec3(frame.material), frame.opacity);
  const Viewport& window = frame.viewport;
  view.window = glm::vec4(window.x, window.y, window.width, window.height);
  const std::vector<glm::vec4> planes = find_planes(frame);
  view.scene = glm::vec4(planes.size(), frame.ground ? 1 : 0, 0, 0);
  std::ranges::copy(planes, view.planes);
  const std::array turns{0.0f, 165.0f, 35.0f, 205.0f, -40.0f, 130.0f, 75.0f, 240.0f};
  for (std::size_t i = 0; i < PALETTE_SIZE; ++i) {
    const glm::vec3 colour = glm::convertSRGBToLinear(turned(options.body_colour, turns[i % turns.size()]));
    view.palette[i] = glm::vec4(colour, 1.0f) * (i < turns.size() ? 1.0f : 0.8f);
  }
  return view;
}

// The values of this frame by vertex, found where they have to be, and their copy on its way back.
GLuint find_values(Renderer& renderer, const Frame& frame) {
  const ViewOptions& options = frame.options;
  const bool of_vertices = options.colour == Colour::velocity || options.colour == Colour::motion ||
                           options.colour == Colour::patch;
  if (options.look == Look::tets && !of_vertices && !options.worst) return 0;
  const GLuint value = vertex_values(renderer, frame);
  if (value) glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT | GL_BUFFER_UPDATE_BARRIER_BIT);
  if (options.worst && value && !renderer.values_copied) {
    const std::size_t bytes = renderer.mesh.positions.size() * sizeof(float);
    if (!renderer.values_copy) renderer.values_copy = Buffer("values' copy", bytes, nullptr, GL_STREAM_READ);
    copy_buffer(value, 0, renderer.values_copy.id(), 0, bytes);
    renderer.values_copied = Fence::here();
  }
  return value;
}

void fill_corners(Renderer& renderer, const Frame& frame, GLuint values) {
  const std::size_t count = 3 * renderer.mesh.surface.size();
  VertexGather& corners = renderer.corners;
  if (!corners) {
    renderer.triangles = Buffer("surface indices", renderer.mesh.surface);
    corners = gather<3>(renderer.mesh, renderer.mesh.surface, {{{1, 2}, {2, 0}, {0, 1}}}, "surface corners",
                        count * sizeof(SurfaceCorner));
    renderer.surface_array = VertexArray("surface");
    const auto part = [&](GLuint index, GLint size, std::size_t offset, GLenum type = GL_FLOAT) {
      attribute(index, corners.values.id(), size, sizeof(SurfaceCorner), offset, type);
    };
    part(ATTRIBUTE_HIGH, 3, offsetof(SurfaceCorner, position));
    part(ATTRIBUTE_LOW, 1, offsetof(SurfaceCorner, kept));
    part(ATTRIBUTE_NORMAL, 4, offsetof(SurfaceCorner, normal_xy), GL_SHORT);
    part(ATTRIBUTE_VALUE, 1, offsetof(SurfaceCorner, value));
  }
  const bool rested = frame.options.is_cut() || renderer.bodies.size() > 1;
  Pass& pass = kernel(renderer, "corners");
  pass.program.set("valued", values ? 1 : 0);
  pass.program.set("rested", rested ? 1 : 0);
  Recorder& recorder = renderer.recorder;
  recorder.give("Positions", frame.positions);
  // What is not asked for is not read, but GL wants some buffer in every block.
  recorder.give("Rest", rested ? rest_of(renderer) : renderer.triangles);
  recorder.give("Values", values ? values : renderer.triangles.id());
  recorder.give("Triangles", renderer.triangles);
  recorder.give("Offsets", corners.offsets), recorder.give("Items", corners.items);
  recorder.give("Corners", corners.values);
  run_over(renderer, pass, count);
}

// To the image or, with `shadow`, to the map.
void draw_bodies(Renderer& renderer, const Frame& frame, GLuint values, bool shadow) {
  const auto elements = [&](const char* program, GLenum kind, const Buffer& indices) {
    use(renderer, std::string(program) + (shadow ? " shadow" : ""));
    bind_vertices(renderer, frame, values);
    glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, indices.id());
    glDrawElements(kind, GLsizei(indices.bytes() / sizeof(std::uint32_t)), GL_UNSIGNED_INT, nullptr);
  };
  const Look look = frame.options.look;
  const bool cut = frame.options.is_cut(), graph = look == Look::graph && !shadow;
  if (graph && !renderer.graph) renderer.graph = Buffer("graph indices", tet_edges(renderer.mesh));
  if (cut) glEnable(GL_CLIP_DISTANCE0);
  if (graph) {  // all of it, mixed
    glEnable(GL_BLEND);
    glDepthMask(GL_FALSE);
    elements("graph", GL_LINES, renderer.graph);
    glDepthMask(GL_TRUE);
  } else if (look == Look::tets) {
    elements("tets", GL_LINES_ADJACENCY, tets_of(renderer));
  } else if (shows_carried(renderer, frame.options)) {
    draw_carried(renderer, frame, use(renderer, shadow ? "carried shadow" : "carried"), values);
  }
  const bool own = look != Look::tets && !graph && !shows_carried(renderer, frame.options);
  const auto all = glm::ivec2(0, 3 * renderer.mesh.surface.size());
  const std::vector<glm::ivec2> parts = own ? std::vector{all} : renderer.sheets;
  if (!graph && !parts.empty()) {
    use(renderer, shadow ? "surface shadow" : "surface");
    glBindVertexArray(renderer.surface_array.id());
    for (const glm::ivec2& part : parts) glDrawArrays(GL_TRIANGLES, part.x, part.y);
  }
  glDisable(GL_CLIP_DISTANCE0);
  if (cut && !graph) elements("caps", GL_LINES_ADJACENCY, tets_of(renderer));
}

// The projection of the light, as far as something of this frame needs it, fitted by the GPU itself.
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
  const Bounds obstacles =
      frame.model ? with_obstacles(nothing, *frame.model, frame.time, INFINITY) : nothing;
  program.set("obstacles_low", glm::vec3(obstacles.low));
  program.set("obstacles_high", glm::vec3(obstacles.high));
  program.set("reach", obstacle_reach * rest_size);
  // Centre and radius of what is worth a shadow: a blown-up vertex must not take the whole map.
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

void make_map(Shadow& shadow) {
  Texture depth("shadow depth");
  clear_errors();
  glTexImage2D(GL_TEXTURE_2D, 0, GL_DEPTH_COMPONENT32F, shadow.size, shadow.size, 0, GL_DEPTH_COMPONENT,
               GL_FLOAT, nullptr);
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
  for (const auto& [sampler, filter] :
       {std::pair{shadow.compared.id(), GL_LINEAR}, {shadow.plain.id(), GL_NEAREST}}) {
    for (GLenum wrap : {GL_TEXTURE_WRAP_S, GL_TEXTURE_WRAP_T})
      glSamplerParameteri(sampler, wrap, GL_CLAMP_TO_BORDER);
    for (GLenum size : {GL_TEXTURE_MIN_FILTER, GL_TEXTURE_MAG_FILTER})
      glSamplerParameteri(sampler, size, filter);
    glSamplerParameterfv(sampler, GL_TEXTURE_BORDER_COLOR, lit.data());
  }
  glSamplerParameteri(shadow.compared.id(), GL_TEXTURE_COMPARE_MODE, GL_COMPARE_REF_TO_TEXTURE);
  glSamplerParameteri(shadow.compared.id(), GL_TEXTURE_COMPARE_FUNC, GL_LEQUAL);
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

// As fine as the picture needs it.
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
    for (GLenum wrap : {GL_TEXTURE_WRAP_S, GL_TEXTURE_WRAP_T})
      glTexParameteri(GL_TEXTURE_2D, wrap, GL_CLAMP_TO_EDGE);
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

bool is_behind(const glm::vec4& plane, const Camera& camera) {
  return glm::dot(glm::vec3(plane), eye(camera)) < plane.w;
}

void draw_plane(Renderer& renderer, const Frame& frame, int number, const glm::vec4& plane) {
  const bool behind = is_behind(plane, frame.camera), wall = number > 0 || !frame.ground;
  const float rest_size = glm::length(renderer.rest_high - renderer.rest_low);
  const Program& program = use(renderer, "plane");
  program.set("plane", number);
  program.set("centre", frame.camera.target);
  program.set("extent", wall ? 2.0f * rest_size : std::max(5.0f * frame.camera.distance, 4.0f * rest_size));
  program.set("opacity", behind ? 0.25f : wall ? 0.85f : 1.0f);
  program.set("grid", frame.options.grid ? 1.0f : 0.0f);
  // What lies on the plane, or penetrates it a little, shall be neither flickering nor hidden from behind.
  glDepthMask(behind || wall ? GL_FALSE : GL_TRUE);
  glEnable(GL_POLYGON_OFFSET_FILL);
  glPolygonOffset(1.0f, 4.0f);
  glBindVertexArray(renderer.empty_array.id());
  glDrawArrays(GL_TRIANGLE_STRIP, 0, 4);
  glDisable(GL_POLYGON_OFFSET_FILL);
  glDepthMask(GL_TRUE);
}

// The ground hides the background, and both are hidden by bodies drawn before. Walls, and a ground seen from
// below, let what is behind them through.
void draw_surroundings(Renderer& renderer, const Frame& frame) {
  const std::vector<glm::vec4> planes = find_planes(frame);
  const bool solid = frame.ground && !is_behind(planes[0], frame.camera);
  glDisable(GL_BLEND);
  if (solid) draw_plane(renderer, frame, 0, planes[0]);
  glDepthFunc(GL_LEQUAL);
  glBindVertexArray(renderer.empty_array.id());
  use(renderer, "background");
  glDrawArrays(GL_TRIANGLES, 0, 3);
  glDepthFunc(GL_LESS);
  glEnable(GL_BLEND);
  for (std::size_t i = solid; i < planes.size(); ++i) draw_plane(renderer, frame, int(i), planes[i]);
}

// However drawing ends, by a shader that does not compile, too.
struct Afterwards {
  ~Afterwards() {
    for (GLenum what : {GL_BLEND, GL_DEPTH_TEST, GL_FRAMEBUFFER_SRGB, GL_SCISSOR_TEST, GL_POLYGON_OFFSET_FILL,
                        GL_DEPTH_CLAMP})
      glDisable(what);
    for (int unit : {UNIT_SHADOW, UNIT_SHADOW_DEPTH, UNIT_PLANES}) glBindSampler(GLuint(unit), 0);
    glBindVertexArray(0);
    glUseProgram(0);
  }
};

}  // namespace

void attribute(GLuint index, GLuint buffer, GLint count, std::size_t stride, std::size_t offset,
               GLenum type) {
  if (!buffer) {
    glDisableVertexAttribArray(index);
    glVertexAttrib4f(index, 0, 0, 0, 0);
    return;
  }
  glBindBuffer(GL_ARRAY_BUFFER, buffer);
  glEnableVertexAttribArray(index);
  glVertexAttribPointer(index, count, type, type != GL_FLOAT, GLsizei(stride),
                        reinterpret_cast<const void*>(offset));
}

Pass& kernel(Renderer& renderer, const std::string& name) {
  if (!renderer.passes.contains(name)) renderer.passes.emplace(name, Pass{compile(name)});
  Pass& pass = renderer.passes.at(name);
  renderer.recorder.use(pass.program);
  return pass;
}

const Program& use(Renderer& renderer, const std::string& name) { return kernel(renderer, name).program; }

void run_over(Renderer& renderer, Pass& pass, std::size_t count) {
  pass.work_groups = work_groups(count, 128);
  renderer.recorder.run(pass, {{"count", unsigned(count)}});
}

void bind_vertices(Renderer& renderer, const Frame& frame, GLuint values) {
  glBindVertexArray(renderer.vertex_array.id());
  attribute(ATTRIBUTE_HIGH, frame.positions, 3, sizeof(Position), offsetof(Position, high));
  attribute(ATTRIBUTE_LOW, frame.positions, 3, sizeof(Position), offsetof(Position, low));
  attribute(ATTRIBUTE_VALUE, values, 1, sizeof(float), 0);
  attribute(ATTRIBUTE_REST, renderer.rest.id(), 4, sizeof(glm::vec4), 0);
}

const Buffer& tets_of(Renderer& renderer) {
  if (!renderer.tets) renderer.tets = Buffer("tet indices", renderer.mesh.tets);
  return renderer.tets;
}

const Buffer& rest_of(Renderer& renderer) {
  if (renderer.rest) return renderer.rest;
  std::vector<glm::vec4> rest;
  std::size_t next = 1;  // body
  for (const glm::dvec3& p : renderer.mesh.positions) {
    while (next < renderer.bodies.size() && rest.size() >= renderer.bodies[next]) ++next;
    rest.emplace_back(glm::vec3(p), float(next - 1));
  }
  return renderer.rest = Buffer("render rest", rest);
}

void bind_view(Renderer& renderer, const Frame& frame) {
  renderer.recorder.begin();
  const View view = view_block(renderer, frame);
  renderer.view.write(0, sizeof view, &view);
  renderer.view.bind_uniform(BIND_RENDER_VIEW);
  glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT);  // the step's positions
  fit_light(renderer, frame);
  // Without a light the block is bound all the same, for GL wants some buffer there; its content is not read.
  (renderer.shadow.light ? renderer.shadow.light : renderer.view).bind_uniform(BIND_RENDER_LIGHT);
}

Renderer make_renderer(TetMesh mesh, std::vector<std::size_t> bodies) {
  Renderer renderer;
  const Bounds rest = bounds(mesh.positions);
  renderer.rest_low = glm::vec3(rest.low), renderer.rest_high = glm::vec3(rest.high);
  renderer.mesh = std::move(mesh);
  renderer.bodies = std::move(bodies);
  renderer.vertex_array = VertexArray("bodies");
  renderer.empty_array = VertexArray("no attributes");
  glBindVertexArray(0);
  renderer.view = Buffer("view", sizeof(View), nullptr, GL_STREAM_DRAW);
  return renderer;
}

Renderer make_renderer(const Model& model) {
  std::vector<std::size_t> bodies;
  for (const Body& body : model.bodies) bodies.push_back(body.first_vertex);
  Renderer renderer = make_renderer(model.rest, std::move(bodies));
  renderer.carried = model.carried;
  for (const Body& body : model.bodies)
    if (body.is_sheet()) renderer.sheets.emplace_back(3 * body.first_triangle, 3 * body.triangles);
  return renderer;
}

// Vertices within 10^-5 of the size of an obstacle that is no half space (the GPU finds those on planes), as
// metrics count them. Waits for the GPU.
static std::vector<std::uint32_t> find_touching(const Sim& sim) {
  auto obstacles = obstacles_at(*sim.model, sim.settings, time_of(sim));
  std::erase_if(obstacles, [](const MovingObstacle& o) { return o.kind->flat; });
  if (obstacles.empty()) return {};
  const double near = 1e-5 * sim.model->size;
  std::vector<std::uint32_t> touching;
  const State state = read_state(sim);
  for (std::uint32_t v = 0; v < state.positions.size(); ++v) {
    const glm::dvec3& x = state.positions[v];
    if (std::ranges::any_of(obstacles, [&](const MovingObstacle& o) {
          return glm::distance(x, o.pose.centre) < 1.01 * o.reach + near && o.surface_at(x).distance < near;
        }))
      touching.push_back(v);
  }
  return touching;
}

void renew(Frame& frame, const Sim& sim) {
  frame.time = time_of(sim);
  frame.pairs = sim.pairs && sim.pairs.near ? &sim.pairs : nullptr;
  if (frame.options.contacts) frame.touching = find_touching(sim);
}

Frame frame_of(const Sim& sim, const Camera& camera, const ViewOptions& options, const Target& target) {
  Frame frame;
  frame.positions = sim.positions.id();
  frame.velocities = sim.velocities.id();
  frame.camera = camera;
  frame.viewport = {0, 0, target.width, target.height};
  frame.options = options;
  if (sim.settings.ground) frame.ground = float(sim.settings.ground_height);
  frame.material = energy_material(sim.settings);
  frame.material.w = float(sim.system.present[index_of<Stretch>] + 2 * sim.system.present[index_of<Volume>]);
  frame.model = sim.model;
  renew(frame, sim);
  const auto held = [&](std::uint32_t v) { return !(sim.inverse_masses[v] > 0); };
  for (const Body& body : sim.model->bodies) {
    const auto vertices =
        std::views::iota(std::uint32_t(body.first_vertex), std::uint32_t(body.first_vertex + body.vertices));
    if (!std::ranges::all_of(vertices, held))  // a body that stands fast as a whole needs no dots
      std::ranges::copy_if(vertices, std::back_inserter(frame.pinned), held);
  }
  frame.target = target.framebuffer.id();
  return frame;
}

void draw(Renderer& renderer, const Frame& frame) {
  if (frame.viewport.width < 1 || frame.viewport.height < 1) return;  // a minimised window
  const Afterwards afterwards;
  const ViewOptions& options = frame.options;
  glDisable(GL_BLEND);
  glDisable(GL_CULL_FACE);
  const int planes = options.backdrop && !frame.over ? int(find_planes(frame).size()) : 0;
  const bool lit_planes = options.shadow && planes > 0, tets = options.look == Look::tets;
  if (tets || options.look == Look::graph || options.is_cut() || renderer.bodies.size() > 1)
    rest_of(renderer);
  bind_view(renderer, frame);
  const GLuint values = find_values(renderer, frame);
  const bool carried = shows_carried(renderer, options);
  if (carried) fill_cofactors(renderer, frame);
  if ((!tets && !carried) || lit_planes || !renderer.sheets.empty()) fill_corners(renderer, frame, values);
  glMemoryBarrier(GL_VERTEX_ATTRIB_ARRAY_BARRIER_BIT | GL_SHADER_STORAGE_BARRIER_BIT |
                  (carried ? GL_TEXTURE_FETCH_BARRIER_BIT : 0));
  if (options.shadow) draw_shadow_map(renderer, frame, values);
  if (lit_planes) light_planes(renderer, frame, planes);

  const Viewport& viewport = frame.viewport;
  glBindFramebuffer(GL_FRAMEBUFFER, frame.target);
  glViewport(viewport.x, viewport.y, viewport.width, viewport.height);
  glScissor(viewport.x, viewport.y, viewport.width, viewport.height);
  glEnable(GL_SCISSOR_TEST);  // so that clearing leaves a neighbouring viewport alone
  glEnable(GL_FRAMEBUFFER_SRGB);
  glDepthMask(GL_TRUE);
  glClearColor(0.7f, 0.73f, 0.76f, 1.0f);
  if (!frame.over)
    glClear(options.backdrop ? GL_DEPTH_BUFFER_BIT : GL_DEPTH_BUFFER_BIT | GL_COLOR_BUFFER_BIT);
  if (options.shadow) bind_shadows(renderer.shadow);
  glEnable(GL_DEPTH_TEST);
  glDepthFunc(GL_LESS);
  glBlendFuncSeparate(GL_SRC_ALPHA, GL_ONE_MINUS_SRC_ALPHA, GL_ONE, GL_ONE);
  const bool surroundings = options.backdrop && !frame.over, mixed = options.look == Look::graph;
  glDisable(GL_BLEND);
  if (!frame.over) draw_obstacles(renderer, frame, false);
  if (surroundings && mixed) draw_surroundings(renderer, frame);
  if (frame.opacity == 1)
    glDisable(GL_BLEND);
  else
    glEnable(GL_BLEND);
  if (frame.over) {  // behind what is there already in the same place, or the two would flicker
    glEnable(GL_POLYGON_OFFSET_FILL);
    glPolygonOffset(2.0f, 16.0f);
  }
  draw_bodies(renderer, frame, values, false);
  glDisable(GL_POLYGON_OFFSET_FILL);
  if (surroundings && !mixed) draw_surroundings(renderer, frame);
  glEnable(GL_BLEND);
  draw_marks(renderer, frame);
  if (!options.has_scale() && frame.caption.empty()) return;
  glDisable(GL_FRAMEBUFFER_SRGB);
  draw_legend(renderer.legend, viewport, options, frame.caption);
}

std::optional<glm::vec3> poll_centre(Renderer& renderer, bool wait) {
  Shadow& shadow = renderer.shadow;
  const auto centre =
      take<glm::vec4>(shadow.centre_copied, shadow.centre, "reading the bodies' middle", wait);
  return centre ? std::optional(glm::vec3(centre->front())) : std::nullopt;
}

std::vector<float> read_values(Renderer& renderer, const Frame& frame) {
  renderer.recorder.begin();
  glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT);
  const GLuint values = vertex_values(renderer, frame);
  std::vector<float> result(values ? renderer.mesh.positions.size() : 0);
  if (values) read_buffer(values, 0, result.size() * sizeof(float), result.data());
  return result;
}

std::optional<std::vector<float>> poll_values(Renderer& renderer, bool wait) {
  return take<float>(renderer.values_copied, renderer.values_copy, "reading values", wait);
}

void measure_distances(Renderer& renderer, GLuint positions, GLuint answers, double size, Buffer& distances) {
  if (!distances) distances = Buffer("vertex values, motion", renderer.mesh.positions.size() * sizeof(float));
  renderer.recorder.begin();
  Pass& pass = kernel(renderer, "distances");
  pass.program.set("scale", float(1 / size));
  renderer.recorder.give("Answers", answers);
  renderer.recorder.barrier(GL_SHADER_STORAGE_BARRIER_BIT);  // the step's positions
  fill(renderer, pass, positions, distances);
}

void reload_shaders(Renderer& renderer) {
  std::map<std::string, Pass> fresh;
  for (const auto& [name, pass] : renderer.passes)
    if (recipes.contains(name)) fresh[name] = {compile(name)};
  renderer.passes = std::move(fresh);
  renderer.touches_sizes.clear();
}

}  // namespace tetpbd
