// Values of the surface's vertices computed from the current positions, each made when first asked for.
#pragma once

#include "sim/gl/gpu.h"
#include "sim/mesh/tet_mesh.h"

namespace tetpbd {

/// What each vertex of the surface gathers, in fixed order: items[offsets[v] .. offsets[v + 1]). Others have
/// none.
struct VertexGather {
  Buffer offsets, items;
  Buffer values;  ///< indexed by vertex
  explicit operator bool() const { return bool(values); }
};

VertexGather make_normals(const TetMesh& mesh);         ///< vec4
VertexGather make_volume_errors(const TetMesh& mesh);   ///< float: mean of V/V0 - 1 over the vertex's tets
VertexGather make_stretch_errors(const TetMesh& mesh);  ///< float: mean of L/L0 - 1 over its edges
/// `kernel`: gather.comp for these values, in use; `rest`: vec4 a vertex, which the normals do not need.
void update(const VertexGather& gather, const Program& kernel, GLuint positions, const Buffer& rest);

}  // namespace tetpbd
