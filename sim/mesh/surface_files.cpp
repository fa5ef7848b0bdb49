#define GLM_ENABLE_EXPERIMENTAL  // hash

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <glm/gtx/hash.hpp>
#include <unordered_map>
#include <utility>

#include "sim/mesh/tet_mesh.h"
#include "sim/mesh/text_file.h"

namespace tetpbd {
namespace {

namespace fs = std::filesystem;

constexpr double weld_tolerance = 1e-7;  // of the bounding box's diagonal, about the spacing of floats
constexpr std::size_t most_corners = 1000;

using Polygon = std::vector<std::uint32_t>;

struct Polygons {
  std::vector<glm::dvec3> positions;
  std::vector<Polygon> faces;
  std::vector<std::size_t> lines{};  ///< of each face, for errors; none where there are no lines
  std::uint32_t first = 0;           ///< the number of the first vertex and face
};

// A number that is no index becomes an index out of range.
std::uint32_t corner(double index) { return index >= 0 && index < 4294967295.0 ? std::uint32_t(index) : ~0u; }

Polygons read_off(const fs::path& file) {
  TextFile text(file, '#');
  text.require_line("OFF");
  const std::string_view word = text.word("OFF");
  if (!word.ends_with("OFF") || word.find_first_of("4n") != word.npos)
    text.fail("file cannot be read as OFF: it does not begin with that word");
  if (!text.more()) text.require_line("the numbers of vertices and faces");
  const std::size_t vertices = text.count("number of vertices"), faces = text.count("number of faces");
  Polygons mesh;
  text.lines(vertices, "vertex", [&] { mesh.positions.push_back(text.position()); });
  text.lines(faces, "face", [&] {
    mesh.lines.push_back(text.line_number());
    Polygon& face = mesh.faces.emplace_back(text.count("number of corners"));
    for (std::uint32_t& v : face) v = corner(double(text.integer("corner of the face")));
  });
  return mesh;
}

Polygons read_obj(const fs::path& file) {
  TextFile text(file, '#');
  Polygons mesh;
  mesh.first = 1;
  while (text.next_line()) {
    const std::string_view keyword = text.word("keyword");
    if (keyword == "v") mesh.positions.push_back(text.position());
    if (keyword != "f") continue;
    mesh.lines.push_back(text.line_number());
    Polygon& face = mesh.faces.emplace_back();
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
      face.push_back(corner(double(index > 0 ? index - 1 : index + std::ssize(mesh.positions))));
    }
  }
  return mesh;
}

Polygons read_stl(const fs::path& file) {
  TextFile text(file);
  const std::string_view bytes = text.bytes(), head = bytes.substr(0, 84);
  Polygons mesh;
  const auto add = [&mesh](Polygon& face, const glm::dvec3& position) {
    face.push_back(std::uint32_t(mesh.positions.size()));
    mesh.positions.push_back(position);
  };
  // Text starts with "solid", and so do some binary files, but text has no zero byte in its first 84.
  if (head.starts_with("solid") && head.find('\0') == head.npos) {
    std::string last;
    Polygon face;
    while (text.next_line()) {
      last = text.word("keyword");
      if (last == "vertex") add(face, text.position());
      if (last == "endloop") mesh.faces.push_back(std::exchange(face, {}));
    }
    if (last != "endsolid") text.fail("file ends before endsolid");
    return mesh;
  }
  std::uint32_t count = 0;
  if (head.size() == 84) std::memcpy(&count, head.data() + 80, sizeof count);
  if (head.size() < 84 || 84 + 50.0 * count > double(bytes.size()))
    text.fail(fmt::format("number of triangles is {}, more than {} bytes can hold", count, bytes.size()));
  for (std::size_t t = 0; t < count; ++t) {
    float numbers[12];  // the normal, three positions
    std::memcpy(numbers, bytes.data() + 84 + 50 * t, sizeof numbers);
    Polygon& face = mesh.faces.emplace_back();
    for (const float* p : {numbers + 3, numbers + 6, numbers + 9}) add(face, {p[0], p[1], p[2]});
  }
  return mesh;
}

struct PlyProperty {
  const NumberType *length, *type;  // `length`: of a list's length; null for a single value
  std::string name;
};
struct PlyElement {
  std::string name;
  std::size_t count;
  std::vector<PlyProperty> properties;
};

std::vector<PlyElement> read_ply_head(TextFile& text, std::string& format) {
  const auto type = [&](std::string_view name) {
    if (const NumberType* found = find_number_type(name)) return found;
    text.fail(fmt::format("'{}' is no type of PLY", name.substr(0, 40)));
  };
  std::vector<PlyElement> elements;
  if (!text.next_line() || text.line() != "ply")
    text.fail("file cannot be read as PLY: it does not begin with that word");
  for (;;) {
    text.require_line("end_header");
    const std::string_view keyword = text.word("keyword");
    if (keyword == "end_header") return elements;
    if (keyword == "format") {
      format = text.word("format");
    } else if (keyword == "element") {
      const std::string name(text.word("name"));
      elements.push_back({name, text.count("number of elements"), {}});
    } else if (keyword == "property" && !elements.empty()) {
      const std::string_view word = text.word("type");
      const NumberType* length = word == "list" ? type(text.word("type")) : nullptr;
      const NumberType* each = type(length ? text.word("type") : word);
      elements.back().properties.push_back({length, each, std::string(text.word("name"))});
    } else if (keyword != "comment" && keyword != "obj_info") {
      text.fail("line is not understood");
    }
  }
}

Polygons read_ply(const fs::path& file) {
  TextFile text(file);
  std::string format;
  const std::vector<PlyElement> elements = read_ply_head(text, format);
  const bool little = format == "binary_little_endian";
  if (format != "ascii" && !little && format != "binary_big_endian")
    text.fail(fmt::format("'{}' is no format of PLY", format.substr(0, 40)));
  text.set_order(format == "ascii" ? Order::text : little ? Order::little : Order::big);
  Polygons mesh;
  for (const PlyElement& element : elements) {
    const auto value = [&, wanted = "value of the " + element.name](const NumberType& type) {
      return format == "ascii" ? text.number(wanted) : text.number_of(type, element.name);
    };
    for (std::size_t i = 0; i < element.count; ++i) {
      if (format == "ascii") text.require_line("its last " + element.name);
      glm::dvec3 position(NAN);
      for (const PlyProperty& property : element.properties) {
        const double length = property.length ? value(*property.length) : 1;
        if (!(length >= 0)) text.fail("length of a list is negative");
        const bool is_list = property.name.starts_with("vertex_ind");
        const bool is_face = is_list && element.name == "face", is_strip = is_list && element.name == "tristrips";
        if (is_face) mesh.faces.emplace_back();
        if (is_face && format == "ascii") mesh.lines.push_back(text.line_number());
        Polygon strip;  // each corner completes a triangle, every other one turned; -1 ends the strip
        for (double k = 0; k < length; ++k) {
          const double number = value(*property.type);
          if (is_face) mesh.faces.back().push_back(corner(number));
          if (is_strip) {
            if (number == -1) {
              strip.clear();
              continue;
            }
            strip.push_back(corner(number));
            if (const std::size_t n = strip.size(); n > 2)
              mesh.faces.push_back({strip[n - 3 + (n % 2 == 0)], strip[n - 2 - (n % 2 == 0)], strip[n - 1]});
          }
          const std::size_t axis = std::string_view("x y z").find(property.name) / 2;  // names have no blank
          if (axis < 3) position[int(axis)] = number;
        }
      }
      if (element.name == "vertex") mesh.positions.push_back(position);
    }
  }
  return mesh;
}

// Cuts off ears: convex corners with no other corner of the polygon inside their triangle.
void add_triangles(SurfaceMesh& surface, Polygon corners) {
  const auto& p = surface.positions;
  const auto normal = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
    return glm::cross(p[b] - p[a], p[c] - p[a]);
  };
  glm::dvec3 outward(0);  // normal of the whole polygon
  for (std::size_t k = 2; k < corners.size(); ++k) outward += normal(corners[0], corners[k - 1], corners[k]);
  while (corners.size() >= 3) {
    const std::size_t n = corners.size();
    const auto is_ear = [&](std::size_t i) {
      const std::uint32_t a = corners[i - 1], b = corners[i], c = corners[(i + 1) % n];
      return glm::dot(normal(a, b, c), outward) > 0 && std::ranges::none_of(corners, [&](std::uint32_t v) {
               return v != a && v != b && v != c && glm::dot(normal(a, b, v), outward) >= 0 &&
                      glm::dot(normal(b, c, v), outward) >= 0 && glm::dot(normal(c, a, v), outward) >= 0;
             });
    };
    std::size_t ear = 1;
    while (ear < n && n > 3 && !is_ear(ear)) ++ear;
    if (ear == n) ear = 1;  // the polygon crosses itself
    surface.triangles.push_back({corners[ear - 1], corners[ear], corners[(ear + 1) % n]});
    corners.erase(corners.begin() + std::ptrdiff_t(ear));
  }
}

constexpr std::pair<const char*, Polygons (*)(const fs::path&)> readers[] = {
    {".ply", read_ply}, {".obj", read_obj}, {".stl", read_stl}, {".off", read_off}};

auto find_reader(const fs::path& file) {
  return std::ranges::find(readers, lower_extension(file), [](const auto& row) { return row.first; });
}

}  // namespace

// Looks up vertices in a grid with cells eight tolerances wide: in a point's own cell, and in a neighbour only where
// the point is within a tolerance of the face between them.
void weld(SurfaceMesh& surface, double tolerance) {
  const auto& positions = surface.positions;
  const Bounds box = bounds(positions);
  // Far from the origin, coordinates are no finer than this, and the numbers of smaller cells would not be exact.
  const double largest = glm::length(glm::max(glm::abs(box.low), glm::abs(box.high)));
  tolerance = std::max({tolerance, largest * 1e-15, 1e-300});
  const auto cell = [&](const glm::dvec3& p) { return glm::floor((p - box.low) / (8 * tolerance)); };
  std::unordered_multimap<glm::dvec3, std::uint32_t> cells;  // vertices that stay
  cells.reserve(positions.size());
  std::vector<std::uint32_t> kept(positions.size());
  for (std::uint32_t v = 0; v < positions.size(); ++v) {
    kept[v] = v;
    const glm::dvec3& p = positions[v];
    if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z)) continue;
    const glm::dvec3 low = cell(p - tolerance), high = cell(p + tolerance);
    for (double x = low.x; x <= high.x; ++x)
      for (double y = low.y; y <= high.y; ++y)
        for (double z = low.z; z <= high.z; ++z) {
          const auto [first, last] = cells.equal_range({x, y, z});
          for (auto at = first; at != last; ++at)
            if (glm::distance(positions[at->second], p) <= tolerance) kept[v] = std::min(kept[v], at->second);
        }
    if (kept[v] == v) cells.emplace(cell(p), v);
  }
  for (Triangle& t : surface.triangles)
    for (std::uint32_t& v : t) v = kept[v];
  std::erase_if(surface.triangles, names_vertex_twice);
  drop_unused_vertices(surface.positions, surface.triangles);
}

bool is_surface_file(const fs::path& file) { return find_reader(file) != std::end(readers); }

SurfaceMesh load_as_is(const fs::path& file) {
  if (!is_surface_file(file)) throw Error("not a surface format", file.string(), "use .ply, .obj, .stl or .off");
  Polygons mesh = find_reader(file)->second(file);
  SurfaceMesh surface{std::move(mesh.positions), {}};
  if (surface.positions.size() >= 0xffffffffu)
    throw Error("mesh is too large for 32-bit indices", file.string(), "use a coarser one");
  const auto place = [&](std::size_t face) {
    return file.string() + (mesh.lines.size() == mesh.faces.size() ? fmt::format(" line {}", mesh.lines[face]) : "");
  };
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    for (const std::uint32_t v : mesh.faces[f])
      if (v >= surface.positions.size())
        throw Error(v == ~0u ? fmt::format("face {} names a vertex that is not there", f + mesh.first)
                             : fmt::format("face {} names vertex {} of {}", f + mesh.first, v + mesh.first,
                                           surface.positions.size()),
                    place(f), "it is damaged: fetch or export it again");
    if (mesh.faces[f].size() > most_corners)
      throw Error(fmt::format("face {} has {} corners", f + mesh.first, mesh.faces[f].size()), place(f),
                  "export the surface as triangles");
    add_triangles(surface, std::move(mesh.faces[f]));
  }
  return surface;
}

SurfaceMesh load_surface(const fs::path& file, bool may_be_empty) {
  SurfaceMesh surface = load_as_is(file);
  weld(surface, weld_tolerance * bounds(surface.positions).size());
  if (surface.triangles.empty() && !may_be_empty)
    throw Error("file holds no triangle", file.string(), "export the surface as triangles or polygons");
  return surface;
}

}  // namespace tetpbd
