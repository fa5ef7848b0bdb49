// What main starts, beside the laboratory (lab.h).
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "app/lab.h"

namespace tetpbd {

/// The words after the program's name. Loads and checks the scene they name, and returns what is left to do;
/// calling that gives the exit status. Throws Error for words that make no command.
std::function<int()> parse_command_line(std::vector<std::string> words);

/// `tetpbd view`: until the window is closed. `name` as it was given, a name or a file; `overrides` stay in
/// force when the same scene is reset. Of the options: size, samples, view.
int run_window(const Scene& scene, const std::string& name, const SceneOverrides& overrides,
               const RunOptions& options);

/// `tetpbd mesh`: checks a mesh, tetrahedralises surfaces with TetGen's `switches`, reports, writes it where
/// `out` says. Exit status: 0, or 1 when tets are inverted.
int run_mesh_command(const std::filesystem::path& file, const std::string& switches,
                     const std::filesystem::path& out, bool json);

}  // namespace tetpbd
