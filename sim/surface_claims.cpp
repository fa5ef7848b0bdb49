#include "sim/surface_claims.h"

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
#include "sim/text_file.h"

namespace tetpbd {
namespace {

[[noreturn]] void throw_short(const std::filesystem::path& file, const std::string& claim, double least,
                              double size) {
  throw Error(fmt::format("file is shorter than its header claims ({}, at least {:.0f} bytes, it has {:.0f})",
                          claim, least, size),
              file.string(), "it is damaged or incomplete: fetch or export it again");
}

double ply_type_size(const std::string& type) {
  if (type == "char" || type == "uchar" || type == "int8" || type == "uint8") return 1;
  if (type == "short" || type == "ushort" || type == "int16" || type == "uint16") return 2;
  if (type == "double" || type == "float64") return 8;
  return 4;
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
          return;
        for (std::size_t k = 0; k < entries; ++k)
          if (next_word().empty()) throw_early_end(file, element.name);
      }
      if (element.name.starts_with("OFF")) rest = {};  // colours may follow on the line
    }
}

SurfaceClaims ply_claims(const std::filesystem::path& file, std::istream& head, double size) {
  SurfaceClaims claims;
  std::vector<TextElement> elements;
  std::string line, element, claim;
  double count = 0, least = 0;
  bool binary = false, first = true;
  while (std::getline(head, line)) {
    std::istringstream words(line);
    std::string word;
    words >> word;
    if (first && word != "ply" && word != "PLY") return {};
    first = false;
    if (word == "format") {
      words >> word;
      binary = word.starts_with("binary");
    } else if (word == "element") {
      if (!(words >> element >> count) || count < 0) return {};
      if (element == "vertex") claims.vertices = static_cast<std::size_t>(std::min(count, 1e15));
      if (element == "face") claims.faces = static_cast<std::size_t>(std::min(count, 1e15));
      elements.push_back({element, static_cast<std::size_t>(std::min(count, 1e15)), {}});
      claim += fmt::format("{}{} {:.0f}", claim.empty() ? "" : ", ", element, count);
    } else if (word == "property") {
      std::string type, counter, entry;
      words >> type;
      if (!elements.empty()) elements.back().lists.push_back(type == "list");
      if (type == "list") {
        words >> counter >> entry;
        const double entries = element == "face" ? 3 : 0;  // no face has fewer corners
        least += count * (binary ? ply_type_size(counter) + entries * ply_type_size(entry) : 2 + 2 * entries);
      } else {
        least += count * (binary ? ply_type_size(type) : 2);
      }
    } else if (word == "end_header") {
      const double body = size - static_cast<double>(head.tellg());
      if (least > body + (binary ? 0 : 1))
        throw_short  // text may lack its last line's end
            (file, claim, least, body);
      for (const TextElement& e : elements)  // assimp would count to the claim, of nothing
        if (e.lists.empty() && e.count > 0)
          throw Error(fmt::format("PLY element '{}' has no properties", e.name), file.string(),
                      "the file is damaged: fetch or export it again");
      if (!binary) require_words(file, head, elements);
      return claims;
    }
  }
  // assimp would search for the end of the header for minutes.
  throw Error("PLY header has no end_header", file.string(),
              "the file is incomplete: fetch or export it again");
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
