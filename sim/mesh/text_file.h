// Reads mesh files: text line by line, with line numbers in errors, and numbers in bytes.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <glm/glm.hpp>
#include <string>
#include <string_view>
#include <type_traits>

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

/// How numbers stand in a file: as words, or in bytes with the lowest or the highest first.
enum class Order { text, little, big };

/// A number in bytes; this machine has the lowest first, as all supported ones do.
template <class T>
T value_of(const char* bytes, Order order) {
  char raw[sizeof(T)];
  std::memcpy(raw, bytes, sizeof raw);
  if (order == Order::big) std::reverse(raw, raw + sizeof raw);
  T value;
  std::memcpy(&value, raw, sizeof value);
  return value;
}

/// Types of numbers that a file names.
struct NumberType {
  std::string_view name, other_name;
  std::size_t size;
  double (*value)(const char*, Order);
};
template <class T>
constexpr NumberType number_type(std::string_view name, std::string_view other_name) {
  return {name, other_name, sizeof(T),
          [](const char* bytes, Order order) { return double(value_of<T>(bytes, order)); }};
}
inline constexpr NumberType real = number_type<double>("double", "float64");
inline constexpr NumberType number_types[] = {real,
                                              number_type<float>("float", "float32"),
                                              number_type<std::int8_t>("char", "int8"),
                                              number_type<std::uint8_t>("uchar", "uint8"),
                                              number_type<std::int16_t>("short", "int16"),
                                              number_type<std::uint16_t>("ushort", "uint16"),
                                              number_type<std::int32_t>("int", "int32"),
                                              number_type<std::uint32_t>("uint", "uint32"),
                                              number_type<std::int64_t>("long", "int64"),
                                              number_type<std::uint64_t>("ulong", "uint64")};
/// Null where there is no such type.
inline const NumberType* find_number_type(std::string_view name) {
  const auto found =
      std::ranges::find_if(number_types, [&](const auto& t) { return name == t.name || name == t.other_name; });
  return found == std::end(number_types) ? nullptr : found;
}

/// Walks through the words of a file and through its bytes. What does not parse throws Error with the file and line.
class TextFile {
 public:
  /// `comment`: the character that starts a comment; '\0': there are none. A byte order mark is no part of the text.
  explicit TextFile(const std::filesystem::path& file, char comment = '\0') : file_(file), comment_(comment) {
    require_readable(file);
    text_.resize(file_size(file));
    if (!std::ifstream(file, std::ios::binary).read(text_.data(), std::streamsize(text_.size())))
      throw Error("cannot be read", file.string(), "check its permissions and the disk");
    if (text_.starts_with("\xEF\xBB\xBF")) text_.erase(0, 3);
    end_ = text_.size();
  }

  /// Confines the words to a part of the file, up to its byte `last`.
  void confine(std::size_t first, std::size_t last) {
    at_ = first, end_ = last, line_ = rest_ = {};
    line_number_ = std::size_t(std::count(text_.begin(), text_.begin() + std::ptrdiff_t(first), '\n'));
  }
  /// How numbers stand from here on: in bytes they follow the line, and next_line() goes to what is behind them.
  void set_order(Order order) { order_ = order; }

  /// Goes to the next line that is not blank; false at the end.
  bool next_line() {
    while (at_ < end_) {
      const std::size_t end = std::min(text_.find('\n', at_), end_);
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
  /// Calls `read` for each of `count` lines, which must be there; where numbers are bytes there are no lines.
  template <class Read>
  void lines(std::size_t count, std::string_view what, const Read& read) {
    for (std::size_t i = 0; i < count; ++i) {
      if (order_ == Order::text && !next_line()) fail(fmt::format("file ends before its last {}", what));
      read();
    }
  }
  std::string_view line() const { return line_; }
  std::string_view bytes() const { return text_; }  ///< all of the file
  /// The next bytes behind the line or those taken before.
  std::string_view take(std::size_t size, std::string_view what) {
    const std::string_view left = bytes().substr(std::min(at_, text_.size()));
    if (size > left.size()) fail(fmt::format("file ends before its last {}", what));
    at_ += size, line_ = rest_ = {}, in_bytes_ = true;
    return left.substr(0, size);
  }

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
    if (std::is_floating_point_v<T>) refuse_comma(found);
    T value{};
    const auto [end, code] = std::from_chars(first, last, value);
    if (code != std::errc{} || end != last)
      fail(fmt::format("'{}' is not a {}number ({})", found.substr(0, 40), std::is_integral_v<T> ? "whole " : "",
                       wanted));
    return value;
  }
  long long integer(std::string_view wanted) { return number<long long>(wanted); }
  /// The next number, in text on this line or a later one, in bytes of this type.
  double number_of(const NumberType& type, std::string_view what) {
    if (order_ != Order::text) return type.value(take(type.size, what).data(), order_);
    while (!more())
      if (!next_line()) fail(fmt::format("file ends before its last {}", what));
    return number(what);
  }
  glm::dvec3 any_position(std::string_view what) {
    const double x = number_of(real, what), y = number_of(real, what), z = number_of(real, what);
    return {x, y, z};
  }
  /// A whole number of the line, in bytes of this type.
  template <class T>
  long long whole(std::string_view wanted) {
    return order_ == Order::text ? integer(wanted) : (long long)(value_of<T>(take(sizeof(T), wanted).data(), order_));
  }
  glm::dvec3 position() {
    const double x = number("x"), y = number("y"), z = number("z");
    return {x, y, z};
  }
  /// A count of items, each of a byte or more in the file.
  std::size_t count(std::string_view wanted) { return counted(integer(wanted), wanted); }
  std::size_t counted(long long value, std::string_view wanted) const {
    if (value < 0) fail(fmt::format("{} is {}", wanted, value));
    if (std::size_t(value) > text_.size())
      fail(fmt::format("{} is {}, more than {} bytes can hold", wanted, value, text_.size()));
    return std::size_t(value);
  }

  [[noreturn]] void fail(const std::string& what, const char* remedy = "repair the file or export it again") const {
    const std::string line = in_bytes_          ? fmt::format(" byte {}", at_)
                             : line_number_ > 0 ? fmt::format(" line {}", line_number_)
                                                : "";
    throw Error(what, file_.string() + line, remedy);
  }
  std::size_t line_number() const { return line_number_; }

 private:
  // Commas stand between numbers, and "1,5" would be two: where that is all of a word, it is meant as one.
  void refuse_comma(std::string_view found) const {
    const std::string_view more = rest_.substr(0, rest_.find_first_of(" \t\r"));
    const bool digits = more.size() > 1 && more[0] == ',' && more[1] >= '0' && more[1] <= '9' &&
                        found.find_first_not_of("+-0123456789") == found.npos;
    const bool listed =
        (found.data() > line_.data() && found.data()[-1] == ',') || more.find_first_of(",.", 1) != more.npos;
    if (!digits || listed) return;
    fail(fmt::format("'{}{}' has a decimal comma", found.substr(0, 20), more.substr(0, 20)), "export with points");
  }

  static constexpr const char* blank = " \t\r,";
  std::filesystem::path file_;
  std::string text_;
  std::string_view line_, rest_;
  std::size_t at_ = 0, end_ = 0, line_number_ = 0;
  char comment_;
  Order order_ = Order::text;
  bool in_bytes_ = false;
};

}  // namespace tetpbd
