// Text files line by line, with line numbers for errors.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <glm/glm.hpp>
#include <iterator>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "sim/error.h"

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
  void require_line(const std::string& wanted);
  std::string_view line() const { return line_; }
  std::string_view bytes() const { return text_; }  ///< all of the file
  std::string_view after_line() const { return std::string_view(text_).substr(std::min(at_, text_.size())); }

  /// Is there another word on the line?
  bool more() const { return rest_.find_first_not_of(blank) != std::string_view::npos; }
  std::string_view word(const char* wanted);
  double number(const char* wanted);
  glm::dvec3 position();
  long long integer(const char* wanted);
  /// A count of items with at least `bytes_each` bytes in the file.
  std::size_t count(const char* wanted, std::size_t bytes_each = 1);

  [[noreturn]] void fail(const std::string& what) const;

 private:
  static constexpr const char* blank = " \t\r,";
  std::filesystem::path file_;
  std::string text_;
  std::string_view line_, rest_;
  std::size_t at_ = 0, line_number_ = 0;
  char comment_;
};

/// A line a row: its number from `first` on (none below 0), `prefix`, then its values, indices with `base`
/// added.
template <class Row>
void put_rows(std::string& text, const std::vector<Row>& rows, std::string_view prefix = "",
              std::uint32_t base = 0, int first = -1) {
  constexpr int width = sizeof(Row) / sizeof(rows[0][0]);
  const auto out = std::back_inserter(text);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (first >= 0) fmt::format_to(out, "{} ", i + std::size_t(first));
    text += prefix;
    for (int k = 0; k < width; ++k) {
      const auto value = rows[i][k];
      if constexpr (std::is_integral_v<decltype(value)>)
        fmt::format_to(out, "{}", value + base);
      else
        fmt::format_to(out, "{}", value);
      text += k + 1 < width ? ' ' : '\n';
    }
  }
}

}  // namespace tetpbd
