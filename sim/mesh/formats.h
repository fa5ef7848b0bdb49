// File formats, for sim/mesh alone: what other rooms call is in tet_mesh.h.
#pragma once

#include "sim/mesh/tet_mesh.h"

namespace tetpbd {

/// TetGen's pair of files (either name), not yet finished.
TetMesh read_node_ele(const std::filesystem::path& file);

/// A file's content, by extension: .ply, .off and .obj as text with all digits, .stl binary.
std::string surface_bytes(const SurfaceMesh& surface, const std::string& extension);

}  // namespace tetpbd
