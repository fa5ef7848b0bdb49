// Which TetGen switches make sense for meshing a surface.
#pragma once

#include <string>

namespace tetpbd {

/// The switches as TetGen is given them: without a leading '-', with Q. Throws Error for switches that need
/// files, do something else than meshing a surface, suppress the result or do not exist, and when p is
/// missing.
std::string checked_switches(const std::string& switches);

}  // namespace tetpbd
