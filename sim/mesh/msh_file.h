// Gmsh's .msh, ASCII, versions 2.2 and 4.1.
#pragma once

#include <filesystem>
#include <string>

#include "sim/mesh/tet_mesh.h"

namespace tetpbd {

/// Nodes and tetrahedra (of second-order ones the corners), not yet finished.
TetMesh read_msh(const std::filesystem::path& file);
/// Version 2.2.
std::string msh_text(const TetMesh& mesh);

}  // namespace tetpbd
