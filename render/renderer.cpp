#include "render/renderer.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <glm/gtc/color_space.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <utility>

#include "render/layout.h"
#include "render/marks.h"
#include "render/parts.h"
#include "sim/gl/layout.h"

namespace tetpbd {

namespace {

/// The shader files of a program, and their defines.
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
    {"edges of a tet", {{"render/body.vert", "render/edge.geom", "render/arrows.frag"}, {}}},
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

// Turns a colour's hue about the grey axis, which keeps its lightness.
glm::vec3 turn_hue(const glm::vec3& colour, float degrees) {
  const glm::mat3 turn(glm::rotate(glm::mat4(1.0f), glm::radians(degrees), glm::vec3(1.0f)));
  return glm::clamp(turn * colour, 0.02f, 1.0f);
}

// The plane (n, w): only the part of the rest shape where n.x <= w is shown.
glm::vec4 cut_plane(const Renderer& renderer, const ViewOptions& options) {
  const glm::vec3 n = options.cut_direction(), middle = 0.5f * (renderer.rest_low + renderer.rest_high);
  const float half = glm::dot(glm::abs(n), 0.5f * (renderer.rest_high - renderer.rest_low));
  return glm::vec4(n, options.is_cut() ? glm::dot(n, middle) + half * float(2 * options.cut - 1) : 1e30f);
}

View view_block(const Renderer& renderer, const Frame& frame) {
  const ViewOptions& options = frame.options;
  View view{};
  const glm::mat4 seen = view_matrix(frame.camera);
  view.camera = projection_matrix(frame.camera, float(frame.viewport.width) / float(frame.viewport.height)) * seen;
  // An edge is sharp from 55 degrees on: the shipped meshes have folds of 50 that ought to look round.
  view.eye = glm::vec4(eye(frame.camera), options.smooth_normals ? 0.574f : 2.0f);
  view.right = glm::vec4(seen[0][0], seen[1][0], seen[2][0], options.shadow ? 1.0f : 0.0f);
  view.colour = glm::vec4(float(options.colour), float(options.range().low), float(options.range().high),
                          options.look == Look::wire ? 0.8f : 0.0f);
  const bool tets = options.look == Look::tets;
  view.tets = tets ? glm::vec4(options.shrink, options.explode, 1, 0) : glm::vec4(0);
  view.cut = cut_plane(renderer, options);
  const Viewport& window = frame.viewport;
  view.window = glm::vec4(window.x, window.y, window.width, window.height);
  const std::vector<glm::vec4> planes = find_planes(frame);
  view.scene = glm::vec4(planes.size(), frame.ground ? 1 : 0, frame.opacity, 0);
  std::ranges::copy(planes, view.planes);
  const std::array turns{0.0f, 165.0f, 35.0f, 205.0f, -40.0f, 130.0f, 75.0f, 240.0f};
  for (std::size_t i = 0; i < PALETTE_SIZE; ++i) {
    const glm::vec3 colour = glm::convertSRGBToLinear(turn_hue(options.body_colour, turns[i % turns.size()]));
    view.palette[i] = glm::vec4(colour, 1.0f) * (i < turns.size() ? 1.0f : 0.8f);
  }
  return view;
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
  // Walls and planes seen from behind hide nothing, and bodies on a plane or slightly in it do not flicker.
  glDepthMask(behind || wall ? GL_FALSE : GL_TRUE);
  glEnable(GL_POLYGON_OFFSET_FILL);
  glPolygonOffset(1.0f, 4.0f);
  glBindVertexArray(renderer.empty_array.id());
  glDrawArrays(GL_TRIANGLE_STRIP, 0, 4);
  glDisable(GL_POLYGON_OFFSET_FILL);
  glDepthMask(GL_TRUE);
}

// The ground hides the background, and bodies drawn before hide both. Walls and a ground seen from below are
// transparent. Leaves blending on.
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

bool has_sheets(const Renderer& renderer) { return std::ranges::any_of(renderer.parts, &Renderer::Part::sheet); }

auto shown_edges(const Renderer& renderer) {
  auto edges = tet_edges(renderer.mesh);
  std::erase_if(edges, [&](const auto& edge) { return is_hidden(renderer, edge[0]); });
  return edges;
}

// Bodies that stand beside each other in the buffer are drawn at once; without `tets` sheets alone.
void draw_parts(const Renderer& renderer, bool tets) {
  glm::ivec2 next(0);
  const auto flush = [&] {
    if (next.y > 0) glDrawArrays(GL_TRIANGLES, next.x, next.y);
  };
  for (const Renderer::Part& part : renderer.parts) {
    if (part.hidden || !(tets || part.sheet)) continue;
    if (next.x + next.y != part.corners.x) flush(), next = {part.corners.x, 0};
    next.y += part.corners.y;
  }
  flush();
}

// Resets the GL state when drawing ends, also by the error of a shader that does not compile.
struct ResetState {
  ~ResetState() {
    for (GLenum what :
         {GL_BLEND, GL_DEPTH_TEST, GL_FRAMEBUFFER_SRGB, GL_SCISSOR_TEST, GL_POLYGON_OFFSET_FILL, GL_DEPTH_CLAMP})
      glDisable(what);
    for (int unit : {UNIT_SHADOW, UNIT_SHADOW_DEPTH, UNIT_PLANES}) glBindSampler(GLuint(unit), 0);
    glBindVertexArray(0);
    glUseProgram(0);
  }
};

}  // namespace

void draw_bodies(Renderer& renderer, const Frame& frame, GLuint values, bool shadow) {
  const auto elements = [&](const char* program, GLenum kind, const Buffer& indices) {
    use(renderer, std::string(program) + (shadow ? " shadow" : ""));
    bind_vertices(renderer, frame, values);
    glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, indices.id());
    glDrawElements(kind, GLsizei(indices.bytes() / sizeof(std::uint32_t)), GL_UNSIGNED_INT, nullptr);
  };
  const Look look = frame.options.look;
  const bool cut = frame.options.is_cut(), graph = look == Look::graph && !shadow,
             carried = shows_carried(renderer, frame.options);
  if (graph && !renderer.graph) renderer.graph = Buffer("graph indices", shown_edges(renderer));
  if (cut) glEnable(GL_CLIP_DISTANCE0);
  if (graph) {  // blended, so that edges within a body show
    glEnable(GL_BLEND);
    glDepthMask(GL_FALSE);
    elements("graph", GL_LINES, renderer.graph);
    glDepthMask(GL_TRUE);
  } else if (look == Look::tets) {
    elements("tets", GL_LINES_ADJACENCY, shown_tet_buffer(renderer));
  } else if (carried) {
    draw_carried(renderer, frame, use(renderer, shadow ? "carried shadow" : "carried"), values);
  }
  const bool own = look != Look::tets && !graph && !carried;
  if (!graph && (own || has_sheets(renderer))) {
    use(renderer, shadow ? "surface shadow" : "surface");
    glBindVertexArray(renderer.surface_array.id());
    draw_parts(renderer, own);
  }
  glDisable(GL_CLIP_DISTANCE0);
  if (cut && !graph) elements("caps", GL_LINES_ADJACENCY, shown_tet_buffer(renderer));
}

void attribute(GLuint index, GLuint buffer, GLint count, std::size_t stride, std::size_t offset, GLenum type) {
  if (!buffer) {
    glDisableVertexAttribArray(index);
    glVertexAttrib4f(index, 0, 0, 0, 0);
    return;
  }
  glBindBuffer(GL_ARRAY_BUFFER, buffer);
  glEnableVertexAttribArray(index);
  glVertexAttribPointer(index, count, type, type != GL_FLOAT, GLsizei(stride), reinterpret_cast<const void*>(offset));
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

const Buffer& tet_buffer(Renderer& renderer) {
  if (!renderer.tets) renderer.tets = Buffer("tet indices", renderer.mesh.tets);
  return renderer.tets;
}

const Buffer& shown_tet_buffer(Renderer& renderer) {
  return renderer.shown_tets ? renderer.shown_tets : tet_buffer(renderer);
}

bool is_hidden(const Renderer& renderer, std::uint32_t vertex) {
  const auto after = std::ranges::upper_bound(renderer.bodies, vertex);
  return after != renderer.bodies.begin() && renderer.parts[std::size_t(after - renderer.bodies.begin()) - 1].hidden;
}

void hide_bodies(Renderer& renderer, const std::vector<bool>& hidden) {
  for (std::size_t b = 0; b < renderer.parts.size(); ++b) renderer.parts[b].hidden = b < hidden.size() && hidden[b];
  renderer.shown_tets = {}, renderer.shown_triangles = {}, renderer.graph = {};
  if (std::ranges::none_of(renderer.parts, &Renderer::Part::hidden)) return;
  const auto shown = [&](auto elements) {
    for (auto& element : elements)
      if (is_hidden(renderer, element[0])) element.fill(element[0]);
    return Buffer("indices of what is shown", elements);
  };
  renderer.shown_tets = shown(renderer.mesh.tets), renderer.shown_triangles = shown(renderer.mesh.surface);
}

const Buffer& rest_buffer(Renderer& renderer) {
  if (renderer.rest) return renderer.rest;
  std::vector<glm::vec4> rest;
  std::size_t next = 1;  // the body after that of the vertex
  for (const glm::dvec3& p : renderer.mesh.positions) {
    while (next < renderer.bodies.size() && rest.size() >= renderer.bodies[next]) ++next;
    rest.emplace_back(glm::vec3(p), float(next - 1));
  }
  return renderer.rest = Buffer("render rest", rest);
}

void bind_materials(Renderer& renderer, const Frame& frame) {
  if (renderer.made_materials != frame.materials) {
    renderer.materials = Buffer("materials of bodies", frame.materials);
    renderer.materials_texture = make_texel_view(renderer.materials);
    renderer.made_materials = frame.materials;
  }
  bind_texels(UNIT_MATERIALS, renderer.materials_texture);
}

void bind_view(Renderer& renderer, const Frame& frame) {
  renderer.recorder.begin();
  bind_materials(renderer, frame);
  const View view = view_block(renderer, frame);
  renderer.view.write(0, sizeof view, &view);
  renderer.view.bind_uniform(BIND_RENDER_VIEW);
  glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT);  // the step's positions
  fit_light(renderer, frame);
  // GL wants some buffer in the block even if there is no light, in which case shaders do not read it.
  (renderer.shadow.light ? renderer.shadow.light : renderer.view).bind_uniform(BIND_RENDER_LIGHT);
}

Renderer make_renderer(TetMesh mesh, std::vector<std::size_t> bodies) {
  Renderer renderer;
  const Bounds rest = bounds(mesh.positions);
  renderer.rest_low = glm::vec3(rest.low), renderer.rest_high = glm::vec3(rest.high);
  renderer.mesh = std::move(mesh);
  renderer.parts = {{glm::ivec2(0, 3 * renderer.mesh.surface.size())}};
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
  renderer.parts.clear();
  for (const Body& body : model.bodies)
    renderer.parts.push_back({glm::ivec2(3 * body.first_triangle, 3 * body.triangles), body.is_sheet()});
  return renderer;
}

void draw(Renderer& renderer, const Frame& frame) {
  if (frame.viewport.width < 1 || frame.viewport.height < 1) return;  // a minimised window
  const ResetState reset;
  const ViewOptions& options = frame.options;
  glDisable(GL_BLEND);
  glDisable(GL_CULL_FACE);
  const bool surroundings = options.backdrop && !frame.over;
  const bool tets = options.look == Look::tets, graph = options.look == Look::graph;
  const int planes = surroundings ? int(find_planes(frame).size()) : 0;
  const bool lit_planes = options.shadow && planes > 0;
  if (tets || graph || options.is_cut() || renderer.bodies.size() > 1) rest_buffer(renderer);
  bind_view(renderer, frame);
  const GLuint values = find_values(renderer, frame);
  const bool carried = shows_carried(renderer, options);
  if (carried) fill_cofactors(renderer, frame);
  if ((!tets && !carried) || lit_planes || has_sheets(renderer)) fill_corners(renderer, frame, values);
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
  if (!frame.over) glClear(options.backdrop ? GL_DEPTH_BUFFER_BIT : GL_DEPTH_BUFFER_BIT | GL_COLOR_BUFFER_BIT);
  if (options.shadow) bind_shadows(renderer.shadow);
  glEnable(GL_DEPTH_TEST);
  glDepthFunc(GL_LESS);
  glBlendFuncSeparate(GL_SRC_ALPHA, GL_ONE_MINUS_SRC_ALPHA, GL_ONE, GL_ONE);
  glDisable(GL_BLEND);
  if (!frame.over) draw_obstacles(renderer, frame, false);
  if (surroundings && graph) draw_surroundings(renderer, frame);
  (frame.opacity == 1 ? glDisable : glEnable)(GL_BLEND);
  if (frame.over) {  // behind the body drawn before in the same place, or the two would flicker
    glEnable(GL_POLYGON_OFFSET_FILL);
    glPolygonOffset(2.0f, 16.0f);
  }
  draw_bodies(renderer, frame, values, false);
  glDisable(GL_POLYGON_OFFSET_FILL);
  if (surroundings && !graph) draw_surroundings(renderer, frame);
  glEnable(GL_BLEND);
  draw_marks(renderer, frame);
  if (!options.has_scale() && frame.caption.empty()) return;
  glDisable(GL_FRAMEBUFFER_SRGB);
  draw_legend(renderer.legend, viewport, options, frame.caption);
}

void reload_shaders(Renderer& renderer) {
  std::map<std::string, Pass> fresh;
  for (const auto& [name, pass] : renderer.passes)
    if (recipes.contains(name)) fresh[name] = {compile(name)};
  renderer.passes = std::move(fresh);
  renderer.contact_sizes.clear();
}

}  // namespace tetpbd
