// Values of the surface's vertices computed from the current positions, each made when first asked for.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

#include "sim/gl/gpu.h"
#include "sim/mesh/tet_mesh.h"

namespace tetpbd {

/// A kernel with one thread a surface vertex, and what each gathers: items[offsets[i] .. offsets[i + 1]), in
/// fixed order.
struct VertexGather {
  Program kernel;
  Buffer vertices, offsets, items;
  Buffer values;  ///< indexed by vertex; only those of the surface are written
  std::size_t count = 0;
  explicit operator bool() const { return count != 0; }
};

VertexGather make_normals(const TetMesh& mesh);         ///< vec4
VertexGather make_volume_errors(const TetMesh& mesh);   ///< float: mean of V/V0 - 1 over the vertex's tets
VertexGather make_stretch_errors(const TetMesh& mesh);  ///< float: mean of L/L0 - 1 over its edges
/// `rest`: vec4 a vertex; the normals need none.
void update(VertexGather& gather, GLuint positions, const Buffer& rest);

}  // namespace tetpbd
