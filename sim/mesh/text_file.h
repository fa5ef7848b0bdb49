// Text files line by line, with line numbers for errors.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>

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

}  // namespace tetpbd
