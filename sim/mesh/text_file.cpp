#include "sim/mesh/text_file.h"

#include <fmt/format.h>

#include <cctype>
#include <charconv>
#include <fstream>

#include "sim/error.h"

namespace tetpbd {
namespace fs = std::filesystem;

std::string lower_extension(const fs::path& file) {
  std::string extension = file.extension().string();
  for (char& c : extension) c = char(std::tolower(static_cast<unsigned char>(c)));
  return extension;
}

void require_readable(const fs::path& file) {
  std::error_code failed;
  const fs::file_status status = fs::status(file, failed);
  if (!fs::exists(status)) throw Error("no such file", file.string(), "check the path");
  if (fs::is_directory(status)) throw Error("is a folder, not a mesh", file.string(), "name a file in it");
  if (!fs::is_regular_file(status)) throw Error("is not a plain file", file.string(), "name a mesh file");
  if (!std::ifstream(file)) throw Error("cannot be read", file.string(), "check its permissions");
  if (fs::file_size(file, failed) == 0 || failed)
    throw Error("file is empty", file.string(), "fetch or export it again");
}

TextFile::TextFile(const fs::path& file, char comment) : file_(file), comment_(comment) {
  require_readable(file);
  text_.resize(fs::file_size(file));
  if (!std::ifstream(file, std::ios::binary).read(text_.data(), std::streamsize(text_.size())))
    throw Error("cannot be read to its end", file.string(), "check the disk");
}

bool TextFile::next_line() {
  while (at_ < text_.size()) {
    const std::size_t end = std::min(text_.find('\n', at_), text_.size());
    line_ = std::string_view(text_).substr(at_, end - at_);
    at_ = end + 1;
    ++line_number_;
    if (comment_ != '\0') line_ = line_.substr(0, line_.find(comment_));
    const std::size_t first = line_.find_first_not_of(blank);
    if (first == std::string_view::npos) continue;
    rest_ = line_ = line_.substr(first, line_.find_last_not_of(blank) - first + 1);
    return true;
  }
  line_ = rest_ = {};
  return false;
}

void TextFile::require_line(std::string_view wanted) {
  if (!next_line()) fail(fmt::format("file ends before {}", wanted));
}

std::string_view TextFile::word(std::string_view wanted) {
  if (!more()) fail(fmt::format("line has no {}", wanted));
  rest_.remove_prefix(rest_.find_first_not_of(blank));
  const std::string_view found = rest_.substr(0, rest_.find_first_of(blank));
  rest_.remove_prefix(found.size());
  return found;
}

template <class T>
T TextFile::value(std::string_view wanted) {
  const std::string_view found = word(wanted);
  const char *first = found.data() + found.starts_with('+'), *last = found.data() + found.size();
  T value{};
  const auto [end, code] = std::from_chars(first, last, value);
  if (code != std::errc{} || end != last)
    fail(fmt::format("'{}' is not a {}number ({})", found.substr(0, 40),
                     std::is_integral_v<T> ? "whole " : "", wanted));
  return value;
}
template double TextFile::value(std::string_view);
template long long TextFile::value(std::string_view);

glm::dvec3 TextFile::position() {
  const double x = number("x"), y = number("y"), z = number("z");
  return {x, y, z};
}

std::size_t TextFile::count(std::string_view wanted) {
  const long long value = integer(wanted);
  if (value < 0) fail(fmt::format("{} is {}", wanted, value));
  if (std::size_t(value) > text_.size())
    fail(fmt::format("{} is {}, more than {} bytes can hold", wanted, value, text_.size()));
  return std::size_t(value);
}

void TextFile::fail(const std::string& what) const {
  const std::string line = line_number_ > 0 ? fmt::format(" line {}", line_number_) : "";
  throw Error(what, file_.string() + line, "mend the file or export it again");
}

}  // namespace tetpbd
