// The command line, read and checked before anything is done.
#pragma once

#include <functional>
#include <string>
#include <vector>

namespace tetpbd {

/// The words after the program's name. Loads and checks the scene they name, and returns what is left to do;
/// calling that gives the exit status. Throws Error for words that make no command.
std::function<int()> parse_command_line(std::vector<std::string> words);

}  // namespace tetpbd
