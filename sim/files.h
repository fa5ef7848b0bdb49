// Files that appear whole or not at all: written under a temporary name, then renamed.
#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

namespace tetpbd {

/// ".NAME.PID.part.EXTENSION" in the same folder: programs choose formats by the extension, so it stays.
std::filesystem::path temporary_name(const std::filesystem::path& file);

/// Gives a finished file its name. Throws Error (status 1) and removes it when that fails.
void rename_whole(const std::filesystem::path& temporary, const std::filesystem::path& file);

/// Throws Error (status 1) and leaves nothing behind when it cannot.
void write_whole(const std::filesystem::path& file, const std::string& content);
/// All are written before the first gets its name.
void write_whole(const std::vector<std::pair<std::filesystem::path, std::string>>& files);

}  // namespace tetpbd
