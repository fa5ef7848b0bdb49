// Text files line by line, with line numbers for errors.
#pragma once

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <glm/glm.hpp>
#include <string>
#include <string_view>

namespace tetpbd {

/// ".PLY" -> ".ply"
std::string lower_extension(const std::filesystem::path& file);

/// Throws Error for a missing file, a folder, one without permission or an empty one.
void require_readable(const std::filesystem::path& file);

/// Walks through the words of a text file. What does not parse throws Error with the file and line.
class TextFile {
 public:
  /// `comment`: the character that starts one, '\0' for none.
  explicit TextFile(const std::filesystem::path& file, char comment = '\0');

  /// Goes to the next line that is not blank; false at the end.
  bool next_line();
  /// The same, where the format requires one: `wanted` says what should stand there.
  void require_line(std::string_view wanted);
  /// A line each, which must be there; `read` takes its words.
  template <class Read>
  void lines(std::size_t count, std::string_view what, const Read& read) {
    for (std::size_t i = 0; i < count; ++i) {
      if (!next_line()) fail("file ends before its last " + std::string(what));
      read();
    }
  }
  std::string_view line() const { return line_; }
  std::string_view bytes() const { return text_; }  ///< all of the file
  std::string_view after_line() const { return std::string_view(text_).substr(std::min(at_, text_.size())); }

  /// Is there another word on the line?
  bool more() const { return rest_.find_first_not_of(blank) != std::string_view::npos; }
  std::string_view word(std::string_view wanted);
  double number(std::string_view wanted) { return value<double>(wanted); }
  long long integer(std::string_view wanted) { return value<long long>(wanted); }
  glm::dvec3 position();
  /// A count of items, each of a byte or more in the file.
  std::size_t count(std::string_view wanted);

  [[noreturn]] void fail(const std::string& what) const;

 private:
  template <class T>
  T value(std::string_view wanted);

  static constexpr const char* blank = " \t\r,";
  std::filesystem::path file_;
  std::string text_;
  std::string_view line_, rest_;
  std::size_t at_ = 0, line_number_ = 0;
  char comment_;
};

}  // namespace tetpbd
