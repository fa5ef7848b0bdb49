#include "render/vertex_data.h"

#include <algorithm>
#include <utility>

#include "render/layout.h"

namespace tetpbd {

namespace {

using Index = std::uint32_t;

// The surface's vertices in increasing order; `row` gives each its place, or none.
struct SurfaceVertices {
  static constexpr Index none = 0xffffffffu;
  std::vector<Index> vertices, row;
  explicit SurfaceVertices(const TetMesh& mesh) : row(mesh.positions.size(), none) {
    for (const Triangle& triangle : mesh.surface)
      for (Index v : triangle) row[v] = 0;
    for (Index v = 0; v < row.size(); ++v)
      if (row[v] == 0) row[v] = Index(vertices.size()), vertices.push_back(v);
  }
};

// `each(add)` calls add(vertex, item...) for every incidence, the same way both times: first counted, then
// stored.
template <int arity, class Each>
VertexGather gather(const TetMesh& mesh, std::string label, std::size_t value_bytes, Program kernel,
                    Each each) {
  const SurfaceVertices surface(mesh);
  VertexGather result;
  result.count = surface.vertices.size();
  std::vector<Index> offsets(result.count + 1, 0);
  each([&](Index v, auto...) {
    if (surface.row[v] != SurfaceVertices::none) ++offsets[surface.row[v] + 1];
  });
  for (std::size_t i = 0; i < result.count; ++i) offsets[i + 1] += offsets[i];
  std::vector<Index> items(std::size_t(offsets.back()) * arity), next(offsets);
  each([&](Index v, auto... others) {
    if (surface.row[v] == SurfaceVertices::none) return;
    Index* place = items.data() + std::size_t(next[surface.row[v]]++) * arity;
    ((*place++ = others), ...);
  });
  result.kernel = std::move(kernel);
  check_work_groups(result.kernel.label(), work_groups(result.count, 128));
  result.vertices = Buffer(label + " vertices", surface.vertices);
  result.offsets = Buffer(label + " offsets", offsets);
  result.items = Buffer(label + " items", items);
  result.values = Buffer(label, mesh.positions.size() * value_bytes);
  result.values.clear();
  return result;
}

std::vector<std::pair<Index, Index>> surface_edges(const TetMesh& mesh, const SurfaceVertices& surface) {
  std::vector<std::pair<Index, Index>> edges;
  for (const Tet& tet : mesh.tets)
    for (std::size_t i = 0; i < 4; ++i)
      for (std::size_t j = i + 1; j < 4; ++j) {
        const auto [a, b] = std::minmax(tet[i], tet[j]);
        if (surface.row[a] != SurfaceVertices::none || surface.row[b] != SurfaceVertices::none)
          edges.emplace_back(a, b);
      }
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  return edges;
}

}  // namespace

VertexGather make_normals(const TetMesh& mesh) {
  return gather<2>(mesh, "vertex normals", sizeof(glm::vec4), Program::compute("render/normals.comp"),
                   [&](auto add) {
                     for (const auto& [a, b, c] : mesh.surface) add(a, b, c), add(b, c, a), add(c, a, b);
                   });
}

VertexGather make_volume_errors(const TetMesh& mesh) {
  // Even permutations, which keep the sign of the volume.
  return gather<3>(mesh, "vertex volume errors", sizeof(float),
                   Program::compute("render/vertex_error.comp", {}, {"VOLUME"}), [&](auto add) {
                     for (const auto& [a, b, c, d] : mesh.tets)
                       add(a, b, c, d), add(b, a, d, c), add(c, a, b, d), add(d, a, c, b);
                   });
}

VertexGather make_stretch_errors(const TetMesh& mesh) {
  const auto edges = surface_edges(mesh, SurfaceVertices(mesh));
  return gather<1>(mesh, "vertex stretch errors", sizeof(float), Program::compute("render/vertex_error.comp"),
                   [&](auto add) {
                     for (const auto& [a, b] : edges) add(a, b), add(b, a);
                   });
}

void update(VertexGather& gather, GLuint positions, const Buffer& rest) {
  gather.kernel.use();
  gather.kernel.set("count", unsigned(gather.count));
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, BIND_RENDER_POSITIONS, positions);
  if (rest) rest.bind_storage(BIND_RENDER_REST);
  gather.vertices.bind_storage(BIND_RENDER_VERTICES);
  gather.offsets.bind_storage(BIND_RENDER_OFFSETS);
  gather.items.bind_storage(BIND_RENDER_ITEMS);
  gather.values.bind_storage(BIND_RENDER_VALUES);
  glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT);  // the step's positions
  glDispatchCompute(unsigned(work_groups(gather.count, 128)), 1, 1);
  glMemoryBarrier(GL_VERTEX_ATTRIB_ARRAY_BARRIER_BIT);
}

}  // namespace tetpbd
