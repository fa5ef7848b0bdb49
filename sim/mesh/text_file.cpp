#include "sim/mesh/text_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <fstream>

namespace tetpbd {
namespace fs = std::filesystem;

std::string lower_extension(const fs::path& file) {
  std::string extension = file.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return char(std::tolower(c)); });
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
  std::ifstream in(file, std::ios::binary);
  text_.resize(fs::file_size(file));
  in.read(text_.data(), std::streamsize(text_.size()));
  if (!in) throw Error("cannot be read to its end", file.string(), "check the disk");
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
    line_ = line_.substr(first, line_.find_last_not_of(blank) - first + 1);
    rest_ = line_;
    return true;
  }
  line_ = rest_ = {};
  return false;
}

void TextFile::require_line(const std::string& wanted) {
  if (!next_line()) fail("file ends before " + wanted);
}

std::string_view TextFile::word(const char* wanted) {
  if (!more()) fail(fmt::format("line has no {}", wanted));
  rest_.remove_prefix(rest_.find_first_not_of(blank));
  const std::string_view found = rest_.substr(0, rest_.find_first_of(blank));
  rest_.remove_prefix(found.size());
  return found;
}

double TextFile::number(const char* wanted) {
  const std::string_view found = word(wanted);
  const char* first = found.data() + (found.front() == '+' ? 1 : 0);
  double value = 0;
  const auto [end, code] = std::from_chars(first, found.data() + found.size(), value);
  if (code != std::errc{} || end != found.data() + found.size())
    fail(fmt::format("'{}' is not a number ({})", found.substr(0, 40), wanted));
  return value;
}

glm::dvec3 TextFile::position() {
  const double x = number("x"), y = number("y"), z = number("z");
  return {x, y, z};
}

long long TextFile::integer(const char* wanted) {
  const std::string_view found = word(wanted);
  long long value = 0;
  const auto [end, code] = std::from_chars(found.data(), found.data() + found.size(), value);
  if (code != std::errc{} || end != found.data() + found.size())
    fail(fmt::format("'{}' is not a whole number ({})", found.substr(0, 40), wanted));
  return value;
}

std::size_t TextFile::count(const char* wanted, std::size_t bytes_each) {
  const long long value = integer(wanted);
  if (value < 0) fail(fmt::format("{} is {}", wanted, value));
  if (static_cast<unsigned long long>(value) > text_.size() / bytes_each + 1)
    fail(fmt::format("{} is {}, more than {} bytes can hold", wanted, value, text_.size()));
  return std::size_t(value);
}

void TextFile::fail(const std::string& what) const {
  const std::string line = line_number_ > 0 ? fmt::format(" line {}", line_number_) : "";
  throw Error(what, file_.string() + line, "mend the file or export it again");
}

}  // namespace tetpbd
