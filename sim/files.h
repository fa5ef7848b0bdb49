// Files that are whole or not there: written under a temporary name, then renamed.
#pragma once

#include <filesystem>
#include <fstream>
#include <string>

namespace tetpbd {

/// finish() renames `part` to `file`; the destructor removes a `part` that is left.
struct PartFile {
  std::filesystem::path file, part;
  explicit PartFile(const std::filesystem::path& name);
  ~PartFile();
  PartFile(const PartFile&) = delete;
  PartFile& operator=(const PartFile&) = delete;
  void finish() const;  ///< throws Error (status 1)
};

/// Text that is written bit by bit; the file appears when close() has succeeded. All functions throw Error.
class GrowingFile {
 public:
  explicit GrowingFile(const std::filesystem::path& file);
  void add(const std::string& text);
  void overwrite_start(const std::string& text);  ///< for what is known only at the end
  void close();

 private:
  PartFile part_;
  std::ofstream stream_;
};

void write_file(const std::filesystem::path& file, const std::string& content);

}  // namespace tetpbd
