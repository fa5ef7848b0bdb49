// Wraps: solids around any triangles, for surfaces that TetGen cannot fill.
#pragma once

#include <optional>
#include <string>

#include "sim/mesh/tet_mesh.h"

namespace tetpbd {

struct WrapOptions {
  int voxels = 80;       ///< along the diagonal of the surface's box
  double thickness = 1;  ///< voxels between the surface and its wrap
};

/// Whether the program was built with OpenVDB.
bool can_wrap();
/// The closed surface around all points nearer than `thickness` to a triangle, where holes narrower than a quarter of
/// the surface count as triangles. Throws Error.
SurfaceMesh wrap(const SurfaceMesh& surface, const WrapOptions& options, const std::string& source);

/// load_surface() without welding and dropping, for repair(), which says what it does.
SurfaceMesh load_as_is(const std::filesystem::path& file);

struct Filled {
  TetMesh mesh;
  std::string note;  ///< what was wrapped, and why; empty where the surface itself was filled
};
/// Tetrahedralizes the surface, or its wrap where the surface is no solid or with `always`; without `options` never
/// wraps. Results are cached. Throws Error for what no wrap repairs.
Filled fill_or_wrap(const SurfaceMesh& surface, const std::string& switches, const std::optional<WrapOptions>& options,
                    bool always, const std::string& source);

}  // namespace tetpbd
