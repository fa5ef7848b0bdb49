// Reads text files line by line, with line numbers in errors.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <filesystem>
#include <fstream>
#include <glm/glm.hpp>
#include <string>
#include <string_view>

#include "sim/error.h"

namespace tetpbd {

/// ".PLY" -> ".ply"
inline std::string lower_extension(const std::filesystem::path& file) {
  std::string extension = file.extension().string();
  for (char& c : extension) c = char(std::tolower(static_cast<unsigned char>(c)));
  return extension;
}

inline void require_readable(const std::filesystem::path& file) {
  std::error_code failed;
  const auto status = std::filesystem::status(file, failed);
  if (!exists(status)) throw Error("no such file", file.string(), "check the path");
  if (!is_regular_file(status))
    throw Error(is_directory(status) ? "is a folder" : "is no plain file", file.string(), "name a mesh file");
  if (file_size(file, failed) == 0 || failed) throw Error("file is empty", file.string(), "fetch or export it again");
}

/// Walks through the words of a text file. What does not parse throws Error with the file and line.
class TextFile {
 public:
  /// `comment`: the character that starts a comment; '\0': there are none.
  explicit TextFile(const std::filesystem::path& file, char comment = '\0') : file_(file), comment_(comment) {
    require_readable(file);
    text_.resize(file_size(file));
    if (!std::ifstream(file, std::ios::binary).read(text_.data(), std::streamsize(text_.size())))
      throw Error("cannot be read", file.string(), "check its permissions and the disk");
  }

  /// Goes to the next line that is not blank; false at the end.
  bool next_line() {
    while (at_ < text_.size()) {
      const std::size_t end = std::min(text_.find('\n', at_), text_.size());
      line_ = std::string_view(text_).substr(at_, end - at_);
      at_ = end + 1;
      ++line_number_;
      if (comment_ != '\0') line_ = line_.substr(0, line_.find(comment_));
      const std::size_t first = line_.find_first_not_of(blank);
      if (first == line_.npos) continue;
      rest_ = line_ = line_.substr(first, line_.find_last_not_of(blank) - first + 1);
      return true;
    }
    line_ = rest_ = {};
    return false;
  }
  /// The same where the format requires a line: `wanted` says what should be there.
  void require_line(std::string_view wanted) {
    if (!next_line()) fail(fmt::format("file ends before {}", wanted));
  }
  /// Calls `read` for each of `count` lines, which must be there.
  template <class Read>
  void lines(std::size_t count, std::string_view what, const Read& read) {
    for (std::size_t i = 0; i < count; ++i) {
      if (!next_line()) fail(fmt::format("file ends before its last {}", what));
      read();
    }
  }
  std::string_view line() const { return line_; }
  std::string_view bytes() const { return text_; }  ///< all of the file
  std::string_view after_line() const { return bytes().substr(std::min(at_, text_.size())); }

  /// Whether there is another word on the line.
  bool more() const { return rest_.find_first_not_of(blank) != rest_.npos; }
  std::string_view word(std::string_view wanted) {
    if (!more()) fail(fmt::format("line has no {}", wanted));
    rest_.remove_prefix(rest_.find_first_not_of(blank));
    const std::string_view found = rest_.substr(0, rest_.find_first_of(blank));
    rest_.remove_prefix(found.size());
    return found;
  }
  template <class T = double>
  T number(std::string_view wanted) {
    const std::string_view found = word(wanted);
    const char *first = found.data() + found.starts_with('+'), *last = found.data() + found.size();
    T value{};
    const auto [end, code] = std::from_chars(first, last, value);
    if (code != std::errc{} || end != last)
      fail(fmt::format("'{}' is not a {}number ({})", found.substr(0, 40), std::is_integral_v<T> ? "whole " : "",
                       wanted));
    return value;
  }
  long long integer(std::string_view wanted) { return number<long long>(wanted); }
  glm::dvec3 position() {
    const double x = number("x"), y = number("y"), z = number("z");
    return {x, y, z};
  }
  /// A count of items, each of a byte or more in the file.
  std::size_t count(std::string_view wanted) {
    const long long value = integer(wanted);
    if (value < 0) fail(fmt::format("{} is {}", wanted, value));
    if (std::size_t(value) > text_.size())
      fail(fmt::format("{} is {}, more than {} bytes can hold", wanted, value, text_.size()));
    return std::size_t(value);
  }

  [[noreturn]] void fail(const std::string& what) const {
    const std::string line = line_number_ > 0 ? fmt::format(" line {}", line_number_) : "";
    throw Error(what, file_.string() + line, "mend the file or export it again");
  }

 private:
  static constexpr const char* blank = " \t\r,";
  std::filesystem::path file_;
  std::string text_;
  std::string_view line_, rest_;
  std::size_t at_ = 0, line_number_ = 0;
  char comment_;
};

}  // namespace tetpbd
