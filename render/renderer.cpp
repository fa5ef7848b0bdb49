#include "render/renderer.h"

#include <algorithm>
#include <cstddef>
#include <glm/gtc/color_space.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <utility>

#include "render/layout.h"
#include "render/marks.h"
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
    {"surface", {{"render/body.vert", "render/surface.geom", "render/body.frag"}, {}}},
    {"surface shadow", {{"render/body.vert", "render/surface.geom", "render/depth.frag"}, {"SHADOW"}}},
    {"tets", {{"render/body.vert", "render/tets.geom", "render/body.frag"}, {}}},
    {"tets shadow", {{"render/body.vert", "render/tets.geom", "render/depth.frag"}, {"SHADOW"}}},
    {"caps", {{"render/body.vert", "render/caps.geom", "render/body.frag"}, {}}},
    {"caps shadow", {{"render/body.vert", "render/caps.geom", "render/depth.frag"}, {"SHADOW"}}},
    {"background", {{"render/background.vert", "render/background.frag"}, {}}},
    {"plane", {{"render/plane.vert", "render/plane.frag"}, {}}},
    {"graph", {{"render/body.vert", "render/graph.geom", "render/graph.frag"}, {}}},
    {"contacts", {{"render/dots.vert", "render/dots.frag"}, {"CONTACTS"}}},
    {"arrows", {{"render/arrows.vert", "render/arrows.geom", "render/arrows.frag"}, {}}},
    {"dots", {{"render/dots.vert", "render/dots.frag"}, {}}},
    {"normals", {{"render/gather.comp"}, {"NORMAL"}}},
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
                    std::size_t value_bytes) {
  const auto corners = [&](std::size_t e, const auto& emit) {
    for (std::size_t k = 0; k < N; ++k) emit(elements[e][k], std::uint32_t(e * N + k));
  };
  const Grouped grouped = group_by_key(elements.size(), mesh.positions.size(), corners);
  std::vector<std::uint32_t> items;
  for (const std::uint32_t corner : grouped.values)
    for (const std::size_t other : others[corner % N]) items.push_back(elements[corner / N][other]);
  return {Buffer(label + " offsets", grouped.first), Buffer(label + " items", items),
          Buffer(label, mesh.positions.size() * value_bytes)};
}

// Dispatches the program in use over all vertices; `values` by vertex.
void fill(const Renderer& renderer, const Program& program, GLuint positions, const Buffer& values) {
  const std::size_t count = renderer.mesh.positions.size();
  program.set("count", unsigned(count));
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, BIND_RENDER_POSITIONS, positions);
  if (renderer.rest) renderer.rest.bind_storage(BIND_RENDER_REST);  // not all need it
  values.bind_storage(BIND_RENDER_VALUES);
  glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT);  // the step's positions
  glDispatchCompute(unsigned(work_groups(count, 128)), 1, 1);
}

// The name of the buffer of values, made when first asked for and filled by their program.
GLuint gathered(Renderer& renderer, const Frame& frame, VertexGather& values, const Program& program,
                const auto& make) {
  if (!values) values = make(renderer.mesh);
  values.offsets.bind_storage(BIND_RENDER_OFFSETS);
  values.items.bind_storage(BIND_RENDER_ITEMS);
  fill(renderer, program, frame.positions, values.values);
  return values.values.id();
}

// Of the frame's colour; 0 where there are none.
GLuint vertex_values(Renderer& renderer, const Frame& frame) {
  const Colour colour = frame.options.colour;
  if (colour == Colour::plain) return 0;
  if (colour == Colour::motion || colour == Colour::patch) return frame.values;
  VertexGather& values = renderer.values[colour];
  const std::string label = std::string("vertex values, ") + colour_names[std::size_t(colour)];
  if (colour == Colour::velocity) {
    if (!values) values.values = Buffer(label, renderer.mesh.positions.size() * sizeof(float));
    const Program& program = use(renderer, "speeds");
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, BIND_RENDER_ANSWERS, frame.velocities);
    fill(renderer, program, frame.positions, values.values);
    return values.values.id();
  }
  if (colour == Colour::stretch)
    return gathered(renderer, frame, values, use(renderer, "edge strains"), [&](const TetMesh& mesh) {
      return gather<2>(mesh, tet_edges(mesh), {{{1}, {0}}}, label, sizeof(float));
    });
  const Program& program = use(renderer, "tet values");
  program.set("kind", int(colour));
  program.set("material", frame.material);
  // Even permutations, which keep the sign of the volume.
  return gathered(renderer, frame, values, program, [&](const TetMesh& mesh) {
    return gather<4>(mesh, mesh.tets, {{{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}}}, label, sizeof(float));
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

View view_block(const Renderer& renderer, const Frame& frame) {
  const ViewOptions& options = frame.options;
  View view{};
  const glm::mat4 seen = view_matrix(frame.camera);
  view.camera =
      projection_matrix(frame.camera, float(frame.viewport.width) / float(frame.viewport.height)) * seen;
  view.eye = glm::vec4(eye(frame.camera), options.smooth_normals && options.look != Look::tets ? 1.0f : 0.0f);
  view.right = glm::vec4(seen[0][0], seen[1][0], seen[2][0], options.shadow ? 1.0f : 0.0f);
  view.colour = glm::vec4(float(options.colour), float(options.range().low), float(options.range().high),
                          options.look == Look::wire ? 0.85f : 0.0f);
  const bool tets = options.look == Look::tets;
  view.tets = tets ? glm::vec4(options.shrink, options.explode, 1, 0) : glm::vec4(0);
  view.cut = cut_plane(renderer, options);
  view.material = glm::vec4(glm::vec3(frame.material), frame.opacity);
  const std::array turns{0.0f, 165.0f, 35.0f, 205.0f, -40.0f, 130.0f, 75.0f, 240.0f};
  for (std::size_t i = 0; i < PALETTE_SIZE; ++i) {
    const glm::vec3 colour = glm::convertSRGBToLinear(turned(options.body_colour, turns[i % turns.size()]));
    view.palette[i] = glm::vec4(colour, 1.0f) * (i < turns.size() ? 1.0f : 0.8f);
  }
  return view;
}

// The vertex attributes of this frame, computed where they have to be, or the constants that stand for them.
void bind_attributes(Renderer& renderer, const Frame& frame) {
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
  const bool tets = options.look == Look::tets, coloured = options.colour != Colour::plain;
  const bool of_vertices = options.colour == Colour::velocity || options.colour == Colour::motion ||
                           options.colour == Colour::patch;
  if (tets || coloured || options.is_cut() || renderer.bodies.size() > 1) rest_of(renderer);
  GLuint normal = 0, value = 0;
  if (!tets && options.smooth_normals)  // the geometry shader of tets has the whole tetrahedron
    normal = gathered(renderer, frame, renderer.normals, use(renderer, "normals"), [](const TetMesh& mesh) {
      return gather<3>(mesh, mesh.surface, {{{1, 2}, {2, 0}, {0, 1}}}, "vertex normals", sizeof(glm::vec4));
    });
  if (!tets || of_vertices || options.worst) value = vertex_values(renderer, frame);
  if (options.worst && value && !renderer.values_copied) {
    const std::size_t bytes = renderer.mesh.positions.size() * sizeof(float);
    if (!renderer.values_copy) renderer.values_copy = Buffer("values' copy", bytes, nullptr, GL_STREAM_READ);
    glMemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT);
    glBindBuffer(GL_COPY_READ_BUFFER, value);
    glBindBuffer(GL_COPY_WRITE_BUFFER, renderer.values_copy.id());
    glCopyBufferSubData(GL_COPY_READ_BUFFER, GL_COPY_WRITE_BUFFER, 0, 0, GLsizeiptr(bytes));
    renderer.values_copied = Fence::here();
  }
  glBindVertexArray(renderer.vertex_array.id());
  attribute(ATTRIBUTE_HIGH, frame.positions, 3, sizeof(Position), offsetof(Position, high));
  attribute(ATTRIBUTE_LOW, frame.positions, 3, sizeof(Position), offsetof(Position, low));
  attribute(ATTRIBUTE_NORMAL, normal, 3, sizeof(glm::vec4), 0);
  attribute(ATTRIBUTE_VALUE, value, 1, sizeof(float), 0);
  attribute(ATTRIBUTE_REST, renderer.rest.id(), 4, sizeof(glm::vec4), 0);
  glMemoryBarrier(GL_VERTEX_ATTRIB_ARRAY_BARRIER_BIT);  // the step's and the kernels'
}

// To the image or, with `shadow`, to the map.
void draw_bodies(Renderer& renderer, const Frame& frame, bool shadow) {
  const auto elements = [&](const char* program, GLenum kind, const Buffer& indices) {
    use(renderer, std::string(program) + (shadow ? " shadow" : ""));
    glBindVertexArray(renderer.vertex_array.id());
    glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, indices.id());
    glDrawElements(kind, GLsizei(indices.bytes() / sizeof(std::uint32_t)), GL_UNSIGNED_INT, nullptr);
  };
  const Look look = frame.options.look;
  const bool cut = frame.options.is_cut(), graph = look == Look::graph && !shadow;
  if (look != Look::tets && !graph && !renderer.triangles)
    renderer.triangles = Buffer("surface indices", renderer.mesh.surface);
  if (graph && !renderer.graph) renderer.graph = Buffer("graph indices", tet_edges(renderer.mesh));
  if (cut) glEnable(GL_CLIP_DISTANCE0);
  if (graph) {  // all of it, mixed
    glEnable(GL_BLEND);
    glDepthMask(GL_FALSE);
    elements("graph", GL_LINES, renderer.graph);
    glDepthMask(GL_TRUE);
  } else if (look == Look::tets) {
    elements("tets", GL_LINES_ADJACENCY, tets_of(renderer));
  } else {
    elements("surface", GL_TRIANGLES, renderer.triangles);
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
    shadow.bounds = Buffer("bounds", std::vector<std::uint32_t>{~0u, ~0u, ~0u, 0, 0, 0});
    shadow.light = Buffer("light", sizeof(Light));
    shadow.centre = Buffer("centre", sizeof(glm::vec4), nullptr, GL_STREAM_READ);
  }
  const std::size_t count = renderer.mesh.positions.size();
  const float rest_size = glm::length(renderer.rest_high - renderer.rest_low);
  const Program& kernel = use(renderer, "shadow fit");
  kernel.set("count", unsigned(count));
  kernel.set("map_size", float(Shadow::size));
  // Centre and radius of what is worth a shadow: a blown-up vertex must not take the whole map.
  kernel.set("limit", glm::vec4(frame.camera.target, 4.0f * std::max(frame.camera.distance, rest_size)));
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, BIND_RENDER_POSITIONS, frame.positions);
  shadow.bounds.bind_storage(BIND_RENDER_BOUNDS);
  shadow.light.bind_storage(BIND_RENDER_FIT);
  for (int stage = 0; stage < 2; ++stage) {
    kernel.set("stage", stage);
    glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT);  // the step's positions, then the bounds
    glDispatchCompute(stage == 0 ? unsigned(work_groups(count, 128)) : 1, 1, 1);
  }
  glMemoryBarrier(GL_UNIFORM_BARRIER_BIT);
  if (!options.follow || shadow.centre_copied) return;
  shadow.light.copy_to(shadow.centre, 0, offsetof(Light, centre), sizeof(glm::vec4));
  shadow.centre_copied = Fence::here();
}

void make_map(Shadow& shadow) {
  Texture depth("shadow depth");
  clear_errors();
  glTexImage2D(GL_TEXTURE_2D, 0, GL_DEPTH_COMPONENT32F, Shadow::size, Shadow::size, 0, GL_DEPTH_COMPONENT,
               GL_FLOAT, nullptr);
  check_memory("the shadow map", std::size_t(Shadow::size) * Shadow::size * 4);
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

void draw_shadow_map(Renderer& renderer, const Frame& frame) {
  if (!renderer.shadow.depth) make_map(renderer.shadow);
  glBindFramebuffer(GL_FRAMEBUFFER, renderer.shadow.framebuffer.id());
  glViewport(0, 0, Shadow::size, Shadow::size);
  glDisable(GL_SCISSOR_TEST);
  glDepthMask(GL_TRUE);
  glClear(GL_DEPTH_BUFFER_BIT);
  glEnable(GL_DEPTH_TEST);
  glDepthFunc(GL_LESS);
  glEnable(GL_POLYGON_OFFSET_FILL);
  glPolygonOffset(1.5f, 2.0f);
  draw_bodies(renderer, frame, true);
  glDisable(GL_POLYGON_OFFSET_FILL);
}

void draw_plane(Renderer& renderer, const Frame& frame, const glm::vec4& plane, bool wall) {
  const bool behind = glm::dot(glm::vec3(plane), eye(frame.camera)) < plane.w;
  const float rest_size = glm::length(renderer.rest_high - renderer.rest_low);
  const Program& program = use(renderer, "plane");
  program.set("plane", plane);
  program.set("centre", frame.camera.target);
  program.set("extent", wall ? 2.0f * rest_size : std::max(5.0f * frame.camera.distance, 4.0f * rest_size));
  program.set("opacity", (wall ? 0.45f : 1.0f) * (behind ? 0.2f : 1.0f));
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

// However drawing ends, by a shader that does not compile, too.
struct Afterwards {
  ~Afterwards() {
    for (GLenum what :
         {GL_BLEND, GL_DEPTH_TEST, GL_FRAMEBUFFER_SRGB, GL_SCISSOR_TEST, GL_POLYGON_OFFSET_FILL})
      glDisable(what);
    for (int unit : {UNIT_SHADOW, UNIT_SHADOW_DEPTH}) glBindSampler(GLuint(unit), 0);
    glBindVertexArray(0);
    glUseProgram(0);
  }
};

}  // namespace

const Program& use(Renderer& renderer, const std::string& name) {
  if (!renderer.programs.contains(name)) renderer.programs.emplace(name, compile(name));
  const Program& program = renderer.programs.at(name);
  program.use();
  return program;
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
  const View view = view_block(renderer, frame);
  renderer.view.write(0, sizeof view, &view);
  renderer.view.bind_uniform(BIND_RENDER_VIEW);
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
  return make_renderer(model.rest, std::move(bodies));
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
  frame.planes.assign(sim.model->obstacles.begin(), sim.model->obstacles.end());
  for (std::uint32_t v = 0; v < sim.inverse_masses.size(); ++v)
    if (!(sim.inverse_masses[v] > 0)) frame.pinned.push_back(v);
  frame.target = target.framebuffer.id();
  return frame;
}

void draw(Renderer& renderer, const Frame& frame) {
  if (frame.viewport.width < 1 || frame.viewport.height < 1) return;  // a minimised window
  const Afterwards afterwards;
  const ViewOptions& options = frame.options;
  glDisable(GL_BLEND);
  glDisable(GL_CULL_FACE);
  bind_view(renderer, frame);
  bind_attributes(renderer, frame);
  if (options.shadow) draw_shadow_map(renderer, frame);

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
  glDisable(GL_DEPTH_TEST);
  glBindVertexArray(renderer.empty_array.id());
  if (options.backdrop && !frame.over) {
    use(renderer, "background");
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
  if (options.backdrop && !frame.over) {
    if (frame.ground) draw_plane(renderer, frame, glm::vec4(0.0f, 1.0f, 0.0f, *frame.ground), false);
    for (const glm::vec4& plane : frame.planes) draw_plane(renderer, frame, plane, true);
  }
  if (frame.opacity == 1) glDisable(GL_BLEND);
  if (frame.over) {  // behind what is there already in the same place, or the two would flicker
    glEnable(GL_POLYGON_OFFSET_FILL);
    glPolygonOffset(2.0f, 16.0f);
  }
  draw_bodies(renderer, frame, false);
  glDisable(GL_POLYGON_OFFSET_FILL);
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

std::optional<std::vector<float>> poll_values(Renderer& renderer, bool wait) {
  return take<float>(renderer.values_copied, renderer.values_copy, "reading values", wait);
}

void measure_distances(Renderer& renderer, GLuint positions, GLuint answers, double size, Buffer& distances) {
  if (!distances) distances = Buffer("vertex values, motion", renderer.mesh.positions.size() * sizeof(float));
  const Program& program = use(renderer, "distances");
  program.set("scale", float(1 / size));
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, BIND_RENDER_ANSWERS, answers);
  fill(renderer, program, positions, distances);
}

void reload_shaders(Renderer& renderer) {
  std::map<std::string, Program> fresh;
  for (const auto& [name, program] : renderer.programs) fresh[name] = compile(name);
  renderer.programs = std::move(fresh);
}

}  // namespace tetpbd
