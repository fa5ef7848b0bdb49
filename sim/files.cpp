#include "sim/files.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>

#include "sim/error.h"

namespace tetpbd {
namespace fs = std::filesystem;

fs::path temporary_name(const fs::path& file) {
  return file.parent_path() /
         fmt::format(".{}.{}.part{}", file.stem().string(), ::getpid(), file.extension().string());
}

void rename_whole(const fs::path& temporary, const fs::path& file) {
  std::error_code failed, ignored;
  fs::rename(temporary, file, failed);
  if (!failed) return;
  fs::remove(temporary, ignored);
  throw Error("cannot be written", file.string(), failed.message(), 1);
}

void write_whole(const fs::path& file, const std::string& content) {
  write_whole(std::vector{std::pair{file, content}});
}

void write_whole(const std::vector<std::pair<fs::path, std::string>>& files) {
  std::error_code ignored;
  try {
    for (const auto& [file, content] : files) {
      fs::remove(temporary_name(file), ignored);  // a link left there is not followed
      std::ofstream stream(temporary_name(file), std::ios::binary);
      stream.write(content.data(), std::streamsize(content.size()));
      stream.close();
      if (!stream) throw Error("cannot be written", file.string(), std::strerror(errno), 1);
      if (fs::is_directory(file))
        throw Error("cannot be written", file.string(), "a folder has that name", 1);
    }
    for (const auto& [file, content] : files) rename_whole(temporary_name(file), file);
  } catch (...) {
    for (const auto& [file, content] : files) fs::remove(temporary_name(file), ignored);
    throw;
  }
}

}  // namespace tetpbd
