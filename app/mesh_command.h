// `tetpbd mesh`: checks a mesh, tetrahedralises it, reports, writes.
#pragma once

#include <filesystem>
#include <string>

namespace tetpbd {

/// `switches` are TetGen's, used for surfaces; `out` may be empty. Prints a table or, with `json`, one JSON
/// object. Returns the exit status: 0 when the mesh is sound, 1 when tets are inverted. Throws Error for
/// anything else.
int run_mesh_command(const std::filesystem::path& file, const std::string& switches,
                     const std::filesystem::path& out, bool json);

}  // namespace tetpbd
