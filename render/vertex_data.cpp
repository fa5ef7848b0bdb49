#include "render/vertex_data.h"

#include <glm/glm.hpp>
#include <numeric>

#include "render/layout.h"

namespace tetpbd {

namespace {

using Index = std::uint32_t;

// `each(add)` calls add(vertex, item...) for every incidence, the same way both times: first counted, then
// stored.
template <int arity, class Each>
VertexGather gather(const TetMesh& mesh, const std::string& label, std::size_t value_bytes, Each each) {
  std::vector<bool> on_surface(mesh.positions.size());
  for (const Triangle& triangle : mesh.surface)
    for (Index v : triangle) on_surface[v] = true;
  std::vector<Index> offsets(mesh.positions.size() + 1, 0);
  each([&](Index v, auto...) { offsets[v + 1] += on_surface[v]; });
  std::partial_sum(offsets.begin(), offsets.end(), offsets.begin());
  std::vector<Index> items(std::size_t(offsets.back()) * arity), next(offsets);
  each([&](Index v, auto... others) {
    if (!on_surface[v]) return;
    Index* item = items.data() + std::size_t(next[v]++) * arity;
    ((*item++ = others), ...);
  });
  return {Buffer(label + " offsets", offsets), Buffer(label + " items", items),
          Buffer(label, mesh.positions.size() * value_bytes)};
}

}  // namespace

VertexGather make_normals(const TetMesh& mesh) {
  return gather<2>(mesh, "vertex normals", sizeof(glm::vec4), [&](auto add) {
    for (const auto& [a, b, c] : mesh.surface) add(a, b, c), add(b, c, a), add(c, a, b);
  });
}

VertexGather make_volume_errors(const TetMesh& mesh) {
  // Even permutations, which keep the sign of the volume.
  return gather<3>(mesh, "vertex volume errors", sizeof(float), [&](auto add) {
    for (const auto& [a, b, c, d] : mesh.tets)
      add(a, b, c, d), add(b, a, d, c), add(c, a, b, d), add(d, a, c, b);
  });
}

VertexGather make_stretch_errors(const TetMesh& mesh) {
  const auto edges = tet_edges(mesh);
  return gather<1>(mesh, "vertex stretch errors", sizeof(float), [&](auto add) {
    for (const auto& [a, b] : edges) add(a, b), add(b, a);
  });
}

void update(const VertexGather& gather, const Program& kernel, GLuint positions, const Buffer& rest) {
  const std::size_t count = gather.offsets.bytes() / sizeof(Index) - 1;
  kernel.set("count", unsigned(count));
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, BIND_RENDER_POSITIONS, positions);
  if (rest) rest.bind_storage(BIND_RENDER_REST);
  gather.offsets.bind_storage(BIND_RENDER_OFFSETS);
  gather.items.bind_storage(BIND_RENDER_ITEMS);
  gather.values.bind_storage(BIND_RENDER_VALUES);
  glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT);  // the step's positions
  glDispatchCompute(unsigned(work_groups(count, 128)), 1, 1);
}

}  // namespace tetpbd
