// Text files line by line with line numbers for errors, and files that appear whole or not at all.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "sim/error.h"

namespace tetpbd {

/// ".PLY" -> ".ply"
std::string lower_extension(const std::filesystem::path& file);

/// Throws Error for a missing file, a folder, one without permission or an empty one.
void require_readable(const std::filesystem::path& file);

/// Walks through the numbers of a text file. What does not parse throws Error with the file and line.
class TextFile {
 public:
  /// `comment`: the character that starts one, '\0' for none.
  TextFile(const std::filesystem::path& file, char comment);

  /// Goes to the next line that is not blank; false at the end.
  bool next_line();
  /// The same, where the format requires one: `wanted` says what should stand there.
  void require_line(const char* wanted);
  std::string_view line() const { return line_; }
  std::size_t bytes() const { return text_.size(); }

  /// The next number of the current line.
  double number(const char* wanted);
  long long integer(const char* wanted);
  /// An integer in 0 .. most.
  std::size_t count(const char* wanted, std::size_t most);
  /// A count of items with at least `bytes_each` bytes in the file.
  std::size_t count_fitting(const char* wanted, std::size_t bytes_each);

  [[noreturn]] void fail(const std::string& what) const;

 private:
  std::filesystem::path file_;
  std::string text_;
  std::string_view line_, rest_;
  std::size_t at_ = 0, line_number_ = 0;
  char comment_;

  std::string_view word(const char* wanted);
};

/// ".NAME.PID.part.EXTENSION" in the same folder: programs choose formats by the extension, so it stays.
std::filesystem::path temporary_name(const std::filesystem::path& file);

/// Gives a finished file its name. Throws Error (status 1) and removes it when that fails.
void rename_whole(const std::filesystem::path& temporary, const std::filesystem::path& file);

/// Writes each file under a temporary name, then renames all. Throws Error (status 1) and leaves nothing
/// behind when it cannot.
void write_files_whole(const std::vector<std::pair<std::filesystem::path, std::string>>& files);

}  // namespace tetpbd
