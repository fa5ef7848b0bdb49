// A solid around any triangles whatever: for surfaces that TetGen cannot fill.
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
/// The outer side of all that is nearer than `thickness` to a triangle, or to one across a hole narrower than
/// a quarter of the surface: closed, and a solid. Throws Error.
SurfaceMesh wrap(const SurfaceMesh& surface, const WrapOptions& options, const std::string& source);

/// load_surface() without welding and dropping: for repair(), which says what it does.
SurfaceMesh load_as_is(const std::filesystem::path& file);

struct Filled {
  TetMesh mesh;
  std::string note;  ///< what was wrapped, and why; empty where the surface itself was filled
};
/// tetrahedralise(), and where it finds no solid, or with `always`, the wrap in place of the surface; without
/// `options` never. Wraps are cached as TetGen's results are. Throws Error for what no wrap mends.
Filled fill_or_wrap(const SurfaceMesh& surface, const std::string& switches, const std::optional<WrapOptions>& options,
                    bool always, const std::string& source);

}  // namespace tetpbd
