#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>

#include "sim/error.h"
#include "sim/mesh/formats.h"
#include "sim/mesh/text_file.h"
#include "sim/mesh/weld.h"

namespace tetpbd {
namespace {

constexpr double weld_tolerance = 1e-7;  // of the bounding box's diagonal: about one step of a float
constexpr std::size_t most_corners = 1000;

struct Polygons {
  std::vector<glm::dvec3> positions;
  std::vector<std::uint32_t> corners;  // of polygon after polygon
  std::vector<std::size_t> ends;       // of each polygon among the corners
  void add_corner(double index) {      // what is no index becomes one that is out of range
    corners.push_back(index >= 0 && index < 4294967295.0 ? std::uint32_t(index) : ~0u);
  }
  void end_polygon() { ends.push_back(corners.size()); }
};

Polygons read_off(const std::filesystem::path& file) {
  TextFile text(file, '#');
  text.require_line("OFF");
  const std::string_view word = text.word("OFF");
  if (!word.ends_with("OFF") || word.find_first_of("4n") != word.npos)
    text.fail("file cannot be read as OFF: it does not begin with that word");
  if (!text.more()) text.require_line("the numbers of vertices and faces");
  const std::size_t vertices = text.count("number of vertices", 6), faces = text.count("number of faces", 6);
  Polygons mesh;
  for (std::size_t v = 0; v < vertices; ++v) {
    text.require_line("its last vertex");
    mesh.positions.push_back(text.position());
  }
  for (std::size_t f = 0; f < faces; ++f) {
    text.require_line("its last face");
    const std::size_t corners = text.count("number of corners");
    for (std::size_t k = 0; k < corners; ++k) mesh.add_corner(double(text.integer("corner of the face")));
    mesh.end_polygon();
  }
  return mesh;
}

Polygons read_obj(const std::filesystem::path& file) {
  TextFile text(file, '#');
  Polygons mesh;
  while (text.next_line()) {
    const std::string_view keyword = text.word("keyword");
    if (keyword == "v") mesh.positions.push_back(text.position());
    if (keyword != "f") continue;
    while (text.more()) {
      const std::string_view word = text.word("corner of the face");  // "3", "3/1", "3//2", "-1"
      if (word == "\\") {
        text.require_line("the rest of its last face");
        continue;
      }
      long long index = 0;
      const auto [end, code] = std::from_chars(word.data(), word.data() + word.size(), index);
      if (code != std::errc{} || (end != word.data() + word.size() && *end != '/') || index == 0)
        text.fail(fmt::format("'{}' is no corner of a face", word.substr(0, 40)));
      mesh.add_corner(double(index > 0 ? index - 1 : index + static_cast<long long>(mesh.positions.size())));
    }
    mesh.end_polygon();
  }
  return mesh;
}

Polygons read_stl(const std::filesystem::path& file) {
  TextFile text(file);
  const std::string_view bytes = text.bytes(), head = bytes.substr(0, 84);
  Polygons mesh;
  const auto add = [&](const glm::dvec3& position) {
    mesh.add_corner(double(mesh.positions.size()));
    mesh.positions.push_back(position);
  };
  // Text starts with "solid" and so do some binary files. Text has no zero byte in its first 84.
  if (head.starts_with("solid") && head.find('\0') == head.npos) {
    std::string last;
    while (text.next_line()) {
      last = text.word("keyword");
      if (last == "vertex") add(text.position());
      if (last == "endloop") mesh.end_polygon();
    }
    if (last != "endsolid") text.fail("file ends before endsolid");
    return mesh;
  }
  std::uint32_t count = 0;
  if (head.size() == 84) std::memcpy(&count, head.data() + 80, sizeof count);
  if (head.size() < 84 || 84 + 50.0 * count > double(bytes.size()))
    text.fail(fmt::format("number of triangles is {}, more than {} bytes can hold", count, bytes.size()));
  for (std::size_t t = 0; t < count; ++t, mesh.end_polygon())
    for (std::size_t k = 0; k < 3; ++k) {
      float p[3];  // after the normal
      std::memcpy(p, bytes.data() + 84 + 50 * t + 12 + 12 * k, sizeof p);
      add({p[0], p[1], p[2]});
    }
  return mesh;
}

template <class T>
double value_of(const char* bytes) {
  T value;
  std::memcpy(&value, bytes, sizeof value);
  return double(value);
}
struct PlyType {
  std::string_view name, other_name;
  std::size_t size;
  double (*value)(const char*);
};
constexpr PlyType ply_types[] = {
    {"char", "int8", 1, value_of<std::int8_t>},    {"uchar", "uint8", 1, value_of<std::uint8_t>},
    {"short", "int16", 2, value_of<std::int16_t>}, {"ushort", "uint16", 2, value_of<std::uint16_t>},
    {"int", "int32", 4, value_of<std::int32_t>},   {"uint", "uint32", 4, value_of<std::uint32_t>},
    {"float", "float32", 4, value_of<float>},      {"double", "float64", 8, value_of<double>}};

struct PlyProperty {
  std::string name;
  const PlyType *type, *length;  // of a list's length; null for a single value
};
struct PlyElement {
  std::string name;
  std::size_t count;
  std::vector<PlyProperty> properties;
};

const PlyType* ply_type(TextFile& text, std::string_view name) {
  for (const PlyType& type : ply_types)
    if (name == type.name || name == type.other_name) return &type;
  text.fail(fmt::format("'{}' is no type of PLY", name.substr(0, 40)));
}

std::vector<PlyElement> read_ply_head(TextFile& text, std::string& format) {
  std::vector<PlyElement> elements;
  if (!text.next_line() || text.line() != "ply")
    text.fail("file cannot be read as PLY: it does not begin with that word");
  for (;;) {
    text.require_line("end_header");
    const std::string_view word = text.word("keyword");
    if (word == "end_header") return elements;
    if (word == "format") {
      format = text.word("format");
    } else if (word == "element") {
      const std::string name(text.word("name"));
      elements.push_back({name, text.count("number of elements"), {}});
    } else if (word == "property" && !elements.empty()) {
      PlyProperty property{};
      std::string_view type = text.word("type");
      if (type == "list") {
        property.length = ply_type(text, text.word("type"));
        type = text.word("type");
      }
      property.type = ply_type(text, type);
      property.name = text.word("name");
      elements.back().properties.push_back(property);
    } else if (word != "comment" && word != "obj_info") {
      text.fail("line is not understood");
    }
  }
}

Polygons read_ply(const std::filesystem::path& file) {
  TextFile text(file);
  std::string format;
  const std::vector<PlyElement> elements = read_ply_head(text, format);
  if (format != "ascii" && format != "binary_little_endian" && format != "binary_big_endian")
    text.fail(fmt::format("'{}' is no format of PLY", format.substr(0, 40)));
  std::string_view bytes = text.after_line();
  const auto value = [&](const PlyType& type, const std::string& element) {
    if (format == "ascii") return text.number(("value of the " + element).c_str());
    if (bytes.size() < type.size) text.fail("file ends before its last " + element);
    char raw[8];
    std::memcpy(raw, bytes.data(), type.size);
    bytes.remove_prefix(type.size);
    if (format == "binary_big_endian") std::reverse(raw, raw + type.size);
    return type.value(raw);
  };
  Polygons mesh;
  for (const PlyElement& element : elements) {
    if (element.properties.empty()) text.fail(fmt::format("element '{}' has no properties", element.name));
    for (std::size_t i = 0; i < element.count; ++i) {
      if (format == "ascii") text.require_line("its last " + element.name);
      glm::dvec3 position(NAN);
      for (const PlyProperty& property : element.properties) {
        const double length = property.length ? value(*property.length, element.name) : 1;
        if (!(length >= 0)) text.fail("length of a list is negative");
        const bool corners = element.name == "face" && property.name.starts_with("vertex_ind");
        for (double k = 0; k < length; ++k) {
          const double number = value(*property.type, element.name);
          if (corners) mesh.add_corner(number);
          if (property.name == "x") position.x = number;
          if (property.name == "y") position.y = number;
          if (property.name == "z") position.z = number;
        }
        if (corners) mesh.end_polygon();
      }
      if (element.name == "vertex") mesh.positions.push_back(position);
    }
  }
  return mesh;
}

// Cuts off ears: corners that turn the polygon's way and have no other corner inside their triangle.
void add_triangles(SurfaceMesh& surface, std::vector<std::uint32_t> corners) {
  const auto& p = surface.positions;
  const auto normal = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
    return glm::cross(p[b] - p[a], p[c] - p[a]);
  };
  glm::dvec3 way(0);
  for (std::size_t k = 2; k < corners.size(); ++k) way += normal(corners[0], corners[k - 1], corners[k]);
  while (corners.size() >= 3) {
    const std::size_t n = corners.size();
    const auto is_ear = [&](std::size_t i) {
      const std::uint32_t a = corners[i - 1], b = corners[i], c = corners[(i + 1) % n];
      return glm::dot(normal(a, b, c), way) > 0 && std::ranges::none_of(corners, [&](std::uint32_t v) {
               return v != a && v != b && v != c && glm::dot(normal(a, b, v), way) >= 0 &&
                      glm::dot(normal(b, c, v), way) >= 0 && glm::dot(normal(c, a, v), way) >= 0;
             });
    };
    std::size_t ear = 1;
    while (ear < n && n > 3 && !is_ear(ear)) ++ear;
    if (ear == n) ear = 1;  // it crosses itself
    surface.triangles.push_back({corners[ear - 1], corners[ear], corners[(ear + 1) % n]});
    corners.erase(corners.begin() + std::ptrdiff_t(ear));
  }
}

}  // namespace

SurfaceMesh load_surface(const std::filesystem::path& file) {
  if (!is_surface_file(file))
    throw Error("not a surface format", file.string(), "use .ply, .obj, .stl or .off");
  const std::string extension = lower_extension(file);
  Polygons mesh = extension == ".ply"   ? read_ply(file)
                  : extension == ".obj" ? read_obj(file)
                  : extension == ".stl" ? read_stl(file)
                                        : read_off(file);
  SurfaceMesh surface{std::move(mesh.positions), {}};
  if (surface.positions.size() >= 0xffffffffu)
    throw Error("mesh is too large for 32-bit indices", file.string(), "use a coarser one");
  std::size_t first = 0;
  for (std::size_t f = 0; f < mesh.ends.size(); first = mesh.ends[f++]) {
    std::vector<std::uint32_t> corners(mesh.corners.begin() + std::ptrdiff_t(first),
                                       mesh.corners.begin() + std::ptrdiff_t(mesh.ends[f]));
    for (const std::uint32_t v : corners)
      if (v >= surface.positions.size())
        throw Error(fmt::format("face {} names vertex {} of {}", f, v, surface.positions.size()),
                    file.string(), "it is damaged: fetch or export it again");
    if (corners.size() > most_corners)
      throw Error(fmt::format("face {} has {} corners", f, corners.size()), file.string(),
                  "export the surface as triangles");
    add_triangles(surface, std::move(corners));
  }
  weld(surface, weld_tolerance * bounds(surface.positions).size());
  if (surface.triangles.empty())
    throw Error("file holds no triangle", file.string(), "export the surface as triangles or polygons");
  return surface;
}

std::string surface_bytes(const SurfaceMesh& s, const std::string& extension) {
  std::string bytes;
  if (extension == ".obj") {
    put_rows(bytes, s.positions, "v ");
    put_rows(bytes, s.triangles, "f ", 1);
    return bytes;
  }
  if (extension == ".off" || extension == ".ply") {
    bytes = extension == ".off"
                ? fmt::format("OFF\n{} {} 0\n", s.positions.size(), s.triangles.size())
                : fmt::format(
                      "ply\nformat ascii 1.0\nelement vertex {}\nproperty double x\nproperty double "
                      "y\nproperty double z\nelement face {}\nproperty list uchar int "
                      "vertex_indices\nend_header\n",
                      s.positions.size(), s.triangles.size());
    put_rows(bytes, s.positions);
    put_rows(bytes, s.triangles, "3 ");
    return bytes;
  }
  const auto put = [&bytes](const auto& value) {  // little-endian, as every machine this runs on
    bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
  };
  bytes = "tetpbd boundary surface";
  bytes.resize(80, '\0');
  put(std::uint32_t(s.triangles.size()));
  for (const Triangle& t : s.triangles) {
    const glm::dvec3 &a = s.positions[t[0]], &b = s.positions[t[1]], &c = s.positions[t[2]];
    for (const glm::dvec3& p : {glm::normalize(glm::cross(b - a, c - a)), a, b, c}) put(glm::vec3(p));
    put(std::uint16_t{0});
  }
  return bytes;
}

}  // namespace tetpbd
