// Finds values by vertex before a picture is drawn: those that colours show, the cofactors of an embedded surface, and
// the corners of the surface.
#include <cstddef>

#include "render/layout.h"
#include "render/parts.h"
#include "sim/parallel.h"

namespace tetpbd {

namespace {

// The items of a vertex are the other corners of each of its elements, in the order of `others`.
template <std::size_t N>
VertexGather gather(const TetMesh& mesh, const std::vector<std::array<std::uint32_t, N>>& elements,
                    const std::array<std::array<std::uint32_t, N - 1>, N>& others, const std::string& label,
                    std::size_t bytes) {
  const auto corners = [&](std::size_t e, const auto& emit) {
    for (std::size_t k = 0; k < N; ++k) emit(elements[e][k], std::uint32_t(e * N + k));
  };
  const Grouped grouped = group_by_key(elements.size(), mesh.positions.size(), corners);
  std::vector<std::uint32_t> items;
  for (const std::uint32_t corner : grouped.values)
    for (const std::uint32_t other : others[corner % N]) items.push_back(elements[corner / N][other]);
  return {Buffer(label + " offsets", grouped.first), Buffer(label + " items", items), Buffer(label, bytes)};
}

// Dispatches a kernel that fills `values` over all vertices. Its inputs are behind a barrier.
void fill(Renderer& renderer, Pass& pass, GLuint positions, const Buffer& values) {
  renderer.recorder.give("Positions", positions);
  renderer.recorder.give("Rest", renderer.rest);
  renderer.recorder.give("Values", values);
  run_over(renderer, pass, renderer.mesh.positions.size());
}

// Fills a buffer of gathered values, made when first needed, and returns its name.
GLuint gathered(Renderer& renderer, const Frame& frame, VertexGather& values, Pass& pass, const auto& make) {
  if (!values) values = make(renderer.mesh);
  renderer.recorder.give("Offsets", values.offsets), renderer.recorder.give("Items", values.items);
  fill(renderer, pass, frame.positions, values.values);
  return values.values.id();
}

// Fills the values of the frame's colour and returns their buffer; 0 if there are none.
GLuint vertex_values(Renderer& renderer, const Frame& frame) {
  const Colour colour = frame.options.colour;
  if (colour == Colour::plain) return 0;
  if (colour == Colour::motion || colour == Colour::patch) return frame.values;
  rest_buffer(renderer);
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
  return gathered(renderer, frame, values, pass,
                  [&](const TetMesh& mesh) { return gather<4>(mesh, mesh.tets, tet_faces, label, bytes); });
}

}  // namespace

void fill_cofactors(Renderer& renderer, const Frame& frame) {
  if (!renderer.carried_array) make_carried(renderer);
  rest_buffer(renderer), tet_buffer(renderer);
  gathered(renderer, frame, renderer.cofactors, kernel(renderer, "cofactors"), [](const TetMesh& mesh) {
    return gather<4>(mesh, mesh.tets, tet_faces, "cofactors", mesh.positions.size() * 3 * sizeof(glm::vec4));
  });
}

GLuint find_values(Renderer& renderer, const Frame& frame) {
  const ViewOptions& options = frame.options;
  const bool of_vertices =
      options.colour == Colour::velocity || options.colour == Colour::motion || options.colour == Colour::patch;
  const bool averaged = std::ranges::any_of(frame.materials, [](const glm::vec4& m) { return m.z == 3; });
  if (options.look == Look::tets && !of_vertices && !averaged && !options.worst) return 0;
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
  // GL wants some buffer in every block, also in those that the kernel does not read.
  recorder.give("Rest", rested ? rest_buffer(renderer) : renderer.triangles);
  recorder.give("Values", values ? values : renderer.triangles.id());
  recorder.give("Triangles", renderer.triangles);
  recorder.give("Offsets", corners.offsets), recorder.give("Items", corners.items);
  recorder.give("Corners", corners.values);
  run_over(renderer, pass, count);
}

std::vector<float> read_values(Renderer& renderer, const Frame& frame) {
  renderer.recorder.begin();
  glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT);
  bind_materials(renderer, frame);
  const GLuint values = vertex_values(renderer, frame);
  std::vector<float> result(values ? renderer.mesh.positions.size() : 0);
  if (values) read_buffer(values, 0, result.size() * sizeof(float), result.data());
  return result;
}

std::optional<std::vector<float>> poll_values(Renderer& renderer, bool wait) {
  return poll_readback<float>(renderer.values_copied, renderer.values_copy, "reading values", wait);
}

void measure_distances(Renderer& renderer, GLuint positions, GLuint reference, double size, Buffer& distances) {
  if (!distances) distances = Buffer("vertex values, motion", renderer.mesh.positions.size() * sizeof(float));
  renderer.recorder.begin();
  Pass& pass = kernel(renderer, "distances");
  pass.program.set("scale", float(1 / size));
  renderer.recorder.give("Reference", reference);
  renderer.recorder.barrier(GL_SHADER_STORAGE_BARRIER_BIT);  // the step's positions
  fill(renderer, pass, positions, distances);
}

}  // namespace tetpbd
