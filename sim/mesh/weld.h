// Merging vertices that stand in the same place.
#pragma once

#include "sim/mesh/tet_mesh.h"

namespace tetpbd {

/// Merges vertices at the same position or nearer than `tolerance` (metres) to one kept before them, drops
/// triangles that collapse by it, then vertices without a triangle. Kept vertices stay in their order.
/// Vertices that are not finite are never merged, so that check_surface() still finds them. Indices must be
/// in range.
void weld(SurfaceMesh& surface, double tolerance);

}  // namespace tetpbd
