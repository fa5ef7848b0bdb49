#include "sim/mesh/surface_claims.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "sim/error.h"
#include "sim/mesh/text_file.h"

namespace tetpbd {
namespace {

[[noreturn]] void throw_short(const std::filesystem::path& file, const std::string& claim, double least,
                              double size) {
  throw Error(fmt::format("file is shorter than its header claims ({}, at least {:.0f} bytes, it has {:.0f})",
                          claim, least, size),
              file.string(), "it is damaged or incomplete: fetch or export it again");
}

// Bytes of a value; 0 for what is no type.
double ply_type_size(const std::string& type) {
  if (type == "char" || type == "uchar" || type == "int8" || type == "uint8") return 1;
  if (type == "short" || type == "ushort" || type == "int16" || type == "uint16") return 2;
  if (type == "int" || type == "uint" || type == "int32" || type == "uint32") return 4;
  if (type == "float" || type == "float32") return 4;
  if (type == "double" || type == "float64") return 8;
  return 0;
}

[[noreturn]] void throw_early_end(const std::filesystem::path& file, const std::string& element) {
  throw Error(fmt::format("file ends before its last {}", element), file.string(),
              "it is damaged or incomplete: fetch or export it again");
}

// Some readers go on with the last line they saw where text ends early, so its words are counted first.
// `lists[k]`: is the element's k-th property a list, with its length in front?
struct TextElement {
  std::string name;
  std::size_t count;
  std::vector<bool> lists;
};

void require_words(const std::filesystem::path& file, std::istream& body,
                   const std::vector<TextElement>& elements) {
  std::string line;
  std::string_view rest;
  const auto next_word = [&]() -> std::string_view {
    for (;;) {
      const std::size_t first = rest.find_first_not_of(" \t\r");
      if (first != std::string_view::npos && rest[first] != '#') {
        rest.remove_prefix(first);
        const std::string_view word = rest.substr(0, rest.find_first_of(" \t\r"));
        rest.remove_prefix(word.size());
        return word;
      }
      if (!std::getline(body, line)) return {};
      rest = line;
    }
  };
  for (const TextElement& element : elements)
    for (std::size_t i = 0; i < element.count; ++i) {
      for (const bool list : element.lists) {
        const std::string_view word = next_word();
        if (word.empty()) throw_early_end(file, element.name);
        std::size_t entries = 0;
        if (list && std::from_chars(word.data(), word.data() + word.size(), entries).ec != std::errc{})
          throw Error(fmt::format("'{}' is not the length of a list", word.substr(0, 40)), file.string(),
                      "it is damaged: fetch or export it again");
        for (std::size_t k = 0; k < entries; ++k)
          if (next_word().empty()) throw_early_end(file, element.name);
      }
      if (element.name.starts_with("OFF")) rest = {};  // colours may follow on the line
    }
}

// Strict: on lines it does not know, and on counts of nothing, assimp searches or counts for minutes.
SurfaceClaims ply_claims(const std::filesystem::path& file, std::istream& head, double size) {
  SurfaceClaims claims;
  std::vector<TextElement> elements;
  std::string line, claim;
  double least = 0;
  bool binary = false, first = true;
  while (std::getline(head, line)) {
    std::istringstream words(line);
    std::string word, type, counter, entry, number;
    words >> word;
    const auto refuse = [&] {
      throw Error(fmt::format("PLY header line '{}' is not understood", line.substr(0, 60)), file.string(),
                  "it is damaged: fetch or export it again");
    };
    if (first && word != "ply" && word != "PLY") return {};
    if (word == "end_header") break;
    if (word == "format") {
      words >> word;
      binary = word.starts_with("binary");
    } else if (word == "element") {
      TextElement element{};
      words >> element.name >> number;
      const auto [end, error] = std::from_chars(number.data(), number.data() + number.size(), element.count);
      if (number.empty() || error != std::errc{} || end != number.data() + number.size()) refuse();
      claim += fmt::format("{}{} {}", claim.empty() ? "" : ", ", element.name, element.count);
      elements.push_back(element);
    } else if (word == "property") {
      if (elements.empty()) refuse();
      TextElement& element = elements.back();
      words >> type;
      element.lists.push_back(type == "list");
      if (element.lists.back()) words >> counter >> entry;
      const double value = ply_type_size(element.lists.back() ? entry : type);
      const double length = element.lists.back() ? ply_type_size(counter) : 0;
      if (value == 0 || (element.lists.back() && length == 0)) refuse();
      const double entries = !element.lists.back()    ? 1
                             : element.name == "face" ? 3
                                                      : 0;  // no face has fewer corners
      const double words_each = entries + (element.lists.back() ? 1 : 0);
      least += static_cast<double>(element.count) * (binary ? length + entries * value : 2 * words_each);
    } else if (!first && !word.empty() && word != "comment" && word != "obj_info") {
      refuse();
    }
    first = false;
  }
  if (!head)
    throw Error("PLY header has no end_header", file.string(),
                "the file is incomplete: fetch or export it again");
  for (const TextElement& element : elements) {
    if (element.lists.empty() && element.count > 0)
      throw Error(fmt::format("PLY element '{}' has no properties", element.name), file.string(),
                  "it is damaged: fetch or export it again");
    if (element.name == "vertex") claims.vertices = element.count;
    if (element.name == "face") claims.faces = element.count;
  }
  const double body = size - static_cast<double>(head.tellg());
  if (least > body + (binary ? 0 : 1))
    throw_short(file, claim, least, body);  // text may lack its last line's end
  if (!binary) require_words(file, head, elements);
  return claims;
}

SurfaceClaims off_claims(const std::filesystem::path& file, std::istream& head, double size) {
  std::string line;
  while (std::getline(head, line)) {
    line = line.substr(0, line.find('#'));
    const std::size_t digit = line.find_first_of("0123456789");
    if (digit == std::string::npos) continue;
    std::istringstream words(line.substr(digit));
    double vertices = 0, faces = 0;
    if (!(words >> vertices >> faces) || !(vertices >= 0) || !(faces >= 0)) return {};
    const double least = vertices * 6 + faces * 8;  // "0 0 0\n", "3 0 1 2\n"
    if (least > size + 1)
      throw_short(file, fmt::format("{:.0f} vertices, {:.0f} faces", vertices, faces), least, size);
    const SurfaceClaims claims{static_cast<std::size_t>(vertices), static_cast<std::size_t>(faces)};
    require_words(
        file, head,
        {{"OFF vertex", *claims.vertices, {false, false, false}}, {"OFF face", *claims.faces, {true}}});
    return claims;
  }
  return {};
}

SurfaceClaims stl_claims(const std::filesystem::path& file, std::istream& head, double size) {
  char start[84] = {};
  head.read(start, sizeof start);
  if (size < 84) return {};  // the shortest text STL with a facet is longer too, and the reader says so
  std::uint32_t count = 0;
  std::memcpy(&count, start + 80, sizeof count);
  const double least = 84 + 50.0 * count;
  // Text starts with "solid" and so do some binary files. Text has no zero byte in its first 84.
  if (std::memchr(start, 0, sizeof start) == nullptr && std::strncmp(start, "solid", 5) == 0) return {};
  if (least > size) throw_short(file, fmt::format("{} triangles", count), least, size);
  return {{}, count};
}

}  // namespace

SurfaceClaims read_surface_claims(const std::filesystem::path& file) {
  std::error_code failed;
  const double size = static_cast<double>(std::filesystem::file_size(file, failed));
  std::ifstream head(file, std::ios::binary);
  if (failed || !head) return {};
  const std::string extension = lower_extension(file);
  if (extension == ".ply") return ply_claims(file, head, size);
  if (extension == ".off") return off_claims(file, head, size);
  if (extension == ".stl") return stl_claims(file, head, size);
  return {};
}

}  // namespace tetpbd
