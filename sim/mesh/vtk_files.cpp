// VTK's unstructured grids: legacy files and XML.
#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "sim/error.h"
#include "sim/mesh/tet_mesh.h"
#include "sim/mesh/text_file.h"

namespace tetpbd {
namespace {

namespace fs = std::filesystem;

using Numbers = std::vector<double>;

/// A part of a grid: three numbers a point; of each cell its type and where its corners end in the list of all.
struct Cells {
  Numbers points, corners, ends, types;
};

[[noreturn]] void refuse(const std::string& what, const fs::path& file) {
  throw Error(what, file.string(), "repair the file or export it again");
}

bool is_whole(double number) { return number == std::floor(number); }

// Other solids by their types: hexahedra, prisms, pyramids, polyhedra, of any order.
bool is_other_solid(double type) {
  constexpr std::array<int, 2> ranges[] = {{11, 16}, {25, 27}, {29, 29}, {31, 33}, {37, 37},
                                           {41, 42}, {65, 67}, {72, 74}, {79, 81}};
  return std::ranges::any_of(ranges, [&](const auto& range) { return type >= range[0] && type <= range[1]; });
}

// Types 10, 24 and 71 are tets, of first, second and any order, and their corners come first.
void add_tets(TetMesh& mesh, const Cells& cells, const fs::path& file) {
  const std::size_t base = mesh.positions.size();
  if (cells.points.size() % 3 != 0) refuse("a point has fewer than three coordinates", file);
  if (cells.ends.size() != cells.types.size())
    refuse(fmt::format("{} cells have {} types", cells.ends.size(), cells.types.size()), file);
  for (std::size_t i = 0; i < cells.points.size(); i += 3)
    mesh.positions.emplace_back(cells.points[i], cells.points[i + 1], cells.points[i + 2]);
  double first = 0;
  for (std::size_t cell = 0; cell < cells.ends.size(); ++cell) {
    const double type = cells.types[cell], last = cells.ends[cell];
    if (!(is_whole(last) && last >= first && last <= double(cells.corners.size())))
      refuse(fmt::format("cell {} has corners up to {}, outside {} .. {}", cell, last, first, cells.corners.size()),
             file);
    if (type == 10 || type == 24 || type == 71) {
      if (last - first < 4) refuse(fmt::format("cell {} is a tet of {} points", cell, last - first), file);
      Tet& tet = mesh.tets.emplace_back();
      for (std::size_t k = 0; k < 4; ++k) {
        const double point = cells.corners[std::size_t(first) + k];
        if (!(is_whole(point) && point >= 0 && point < double(mesh.positions.size() - base)))
          refuse(fmt::format("cell {} names point {} of {}", cell, point, mesh.positions.size() - base), file);
        tet[k] = std::uint32_t(base + std::size_t(point));
      }
    }
    mesh.other_cells += is_other_solid(type);
    first = last;
  }
  if (first != double(cells.corners.size()))
    refuse(fmt::format("cells have {} corners, and {} are there", first, cells.corners.size()), file);
}

// ------------------------------------------------------------------------------------------------------------
// XML: tags are taken in their order, what they hold is not checked against a schema

std::string_view attribute(std::string_view tag, std::string_view name) {
  for (std::size_t at = 0; (at = tag.find(name, at + 1)) != tag.npos;) {
    const std::string_view rest = tag.substr(at + name.size());
    if (!std::isspace(static_cast<unsigned char>(tag[at - 1])) || !rest.starts_with('=') || rest.size() < 3) continue;
    const std::size_t end = rest.find(rest[1], 2);
    if (end != rest.npos) return rest.substr(2, end - 2);
  }
  return {};
}

// Of groups of four digits; one that is filled up with '=' may have others behind it. Stops at what is no digit.
std::string from_base64(std::string_view text) {
  std::string bytes;
  unsigned bits = 0, count = 0, filled = 0;
  for (const char c : text) {
    if (std::isspace(static_cast<unsigned char>(c))) continue;
    const int digit = c >= 'A' && c <= 'Z'   ? c - 'A'
                      : c >= 'a' && c <= 'z' ? c - 'a' + 26
                      : c >= '0' && c <= '9' ? c - '0' + 52
                      : c == '+'             ? 62
                      : c == '/'             ? 63
                      : c == '='             ? 0
                                             : -1;
    if (digit < 0) break;
    filled += c == '=';
    bits = bits << 6 | unsigned(digit);
    if (++count < 4) continue;
    for (unsigned k = 0; k + filled < 3; ++k) bytes += char(bits >> (16 - 8 * k) & 0xff);
    bits = count = filled = 0;
  }
  return bytes;
}

struct VtuReader {
  TextFile text;
  fs::path file;
  std::string_view head{}, appended{}, encoding{};  ///< the first tag; what follows '_' in <AppendedData>
  std::string_view array{};                         ///< the tag of the array that is read

  [[noreturn]] void fail(const std::string& what) const {
    refuse(fmt::format("{} (array '{}')", what, attribute(array, "Name").substr(0, 40)), file);
  }
  std::size_t take_header(std::string_view& bytes) const {
    const bool wide = attribute(head, "header_type") == "UInt64";
    if (bytes.size() < (wide ? 8 : 4)) fail("file ends before the length of an array");
    const std::size_t value =
        wide ? value_of<std::uint64_t>(bytes.data(), order()) : value_of<std::uint32_t>(bytes.data(), order());
    bytes.remove_prefix(wide ? 8 : 4);
    return value;
  }
  Order order() const { return attribute(head, "byte_order") == "BigEndian" ? Order::big : Order::little; }

  // The number of blocks, the size of each and of the last (0: as the others), the size of each when compressed.
  std::string inflated(std::string_view bytes) const {
    const std::size_t count = take_header(bytes), size = take_header(bytes), last = take_header(bytes);
    if (count > bytes.size()) fail(fmt::format("{} blocks are more than {} bytes can hold", count, bytes.size()));
    std::vector<std::size_t> packed(count);
    for (std::size_t& length : packed) length = take_header(bytes);
    std::string result;
    for (std::size_t b = 0; b < count; ++b) {
      const std::size_t wanted = b + 1 == count && last > 0 ? last : size;
      // Deflate makes at most about a thousand bytes of one.
      if (packed[b] > bytes.size() || wanted / 1100 > packed[b]) fail("a compressed block is longer than its bytes");
      const std::size_t before = result.size();
      result.resize(before + wanted);
      uLongf made = wanted;
      if (uncompress(reinterpret_cast<Bytef*>(result.data() + before), &made,
                     reinterpret_cast<const Bytef*>(bytes.data()), packed[b]) != Z_OK ||
          made != wanted)
        fail("a compressed block is damaged");
      bytes.remove_prefix(packed[b]);
    }
    return result;
  }

  // `first`, `last`: of what is between the array's tags.
  Numbers read(std::size_t first, std::size_t last) {
    std::string name(attribute(array, "type"));
    for (char& c : name) c = char(std::tolower(static_cast<unsigned char>(c)));
    const NumberType* type = find_number_type(name);
    if (!type) fail(fmt::format("'{}' is no type of VTK", name.substr(0, 40)));
    Numbers numbers;
    const std::string_view format = attribute(array, "format");
    if (format == "ascii") {
      text.confine(first, last);
      while (text.next_line())
        while (text.more()) numbers.push_back(text.number("value"));
      return numbers;
    }
    std::string_view bytes = text.bytes().substr(first, last - first);
    std::string made;
    if (format == "appended") {
      const std::string_view offset = attribute(array, "offset");
      std::size_t at = 0;
      std::from_chars(offset.data(), offset.data() + offset.size(), at);
      if (offset.empty() || at > appended.size()) fail(fmt::format("offset '{}' is not there", offset.substr(0, 40)));
      bytes = appended.substr(at);
    } else if (format != "binary") {
      fail(fmt::format("'{}' is no format of VTK", format.substr(0, 40)));
    }
    if (format == "binary" || encoding == "base64") bytes = made = from_base64(bytes);
    const std::string_view compressor = attribute(head, "compressor");
    if (!compressor.empty() && compressor != "vtkZLibDataCompressor")
      throw Error(fmt::format("data compressed by {} are not supported", compressor.substr(0, 40)), file.string(),
                  "save it as ASCII, uncompressed or compressed by ZLib");
    if (!compressor.empty()) {
      bytes = made = inflated(bytes);
    } else {
      const std::size_t length = take_header(bytes);
      if (length > bytes.size()) fail(fmt::format("array of {} bytes has {}", length, bytes.size()));
      bytes = bytes.substr(0, length);
    }
    for (; bytes.size() >= type->size; bytes.remove_prefix(type->size))
      numbers.push_back(type->value(bytes.data(), order()));
    return numbers;
  }
};

}  // namespace

TetMesh read_vtu(const fs::path& file) {
  VtuReader reader{TextFile(file), file};
  const std::string_view bytes = reader.text.bytes(), xml = bytes.substr(0, bytes.find("<AppendedData"));
  if (xml.size() < bytes.size()) {
    const std::string_view rest = bytes.substr(xml.size());
    reader.encoding = attribute(rest.substr(0, rest.find('>')), "encoding");
    reader.appended = rest.substr(std::min(rest.find('_', std::min(rest.find('>'), rest.size())), rest.size() - 1) + 1);
  }
  TetMesh mesh;
  Cells cells;
  std::string_view piece, inside;
  for (std::size_t at = 0; (at = xml.find('<', at)) != xml.npos; ++at) {
    if (xml.substr(at).starts_with("<!--")) {
      at = std::min(xml.find("-->", at), xml.size());
      continue;
    }
    const std::string_view tag = xml.substr(at, xml.find('>', at) - at);
    const std::string_view name = tag.substr(1, tag.find_first_of(" \t\r\n/", 2) - 1);
    if (name == "VTKFile") reader.head = tag;
    if (name == "Piece") piece = tag, cells = {};
    if (name == "Points" || name == "Cells") inside = name;
    if (name == "/Points" || name == "/Cells") inside = {};
    if (name == "DataArray" && !inside.empty()) {
      const std::string_view named = attribute(tag, "Name");
      Numbers* target = inside == "Points"        ? &cells.points
                        : named == "connectivity" ? &cells.corners
                        : named == "offsets"      ? &cells.ends
                        : named == "types"        ? &cells.types
                                                  : nullptr;
      reader.array = tag;
      const std::size_t first = std::min(at + tag.size() + 1, xml.size());
      if (target) *target = reader.read(first, std::min(xml.find('<', first), xml.size()));
    }
    if (name != "/Piece") continue;
    for (const auto& [count, found] :
         {std::pair("NumberOfPoints", cells.points.size() / 3), std::pair("NumberOfCells", cells.types.size())})
      if (attribute(piece, count) != std::to_string(found))
        refuse(fmt::format("{} is {}, {} found", count, attribute(piece, count).substr(0, 40), found), file);
    add_tets(mesh, cells, file);
  }
  if (attribute(reader.head, "type") != "UnstructuredGrid") refuse("file is no VTKFile of type UnstructuredGrid", file);
  if (bytes.rfind("</VTKFile>") == bytes.npos) refuse("file ends before </VTKFile>", file);
  return mesh;
}

// ------------------------------------------------------------------------------------------------------------
// legacy

TetMesh read_vtk(const fs::path& file) {
  TextFile text(file);
  constexpr std::string_view begin = "# vtk DataFile Version ";
  if (!text.next_line() || !text.line().starts_with(begin)) text.fail("file does not begin with '# vtk DataFile'");
  const bool lists = text.line().substr(begin.size()) >= "5";  // of corners and of ends, apart
  while (text.line() != "ASCII" && text.line() != "BINARY") text.require_line("ASCII or BINARY");
  const Order order = text.line() == "ASCII" ? Order::text : Order::big;
  const auto read = [&](std::size_t count, std::string name, const char* what) {
    if (name.starts_with("unsigned_")) name.replace(0, 9, "u");
    if (name.starts_with("vtktype")) name.erase(0, 7);
    const NumberType* type = find_number_type(name);
    if (!type) text.fail(fmt::format("'{}' is no type of VTK", name.substr(0, 40)));
    text.counted((long long)(count), "number of values");
    text.set_order(order);
    Numbers numbers;
    while (numbers.size() < count) numbers.push_back(text.number_of(*type, what));
    text.set_order(Order::text);
    if (text.more()) text.fail("line has more numbers than are declared");
    return numbers;
  };
  Cells cells;
  bool grid = false;
  while (text.next_line()) {
    const std::string_view keyword = text.word("keyword");
    if (keyword == "DATASET") {
      grid = text.word("kind of grid") == "UNSTRUCTURED_GRID";
      if (!grid) text.fail("file holds no unstructured grid");
    } else if (keyword == "POINTS") {
      const std::size_t count = text.count("number of points");
      cells.points = read(3 * count, std::string(text.word("type")), "point");
    } else if (keyword == "CELLS") {
      const std::size_t count = text.count("number of cells"), size = text.count("size of the list");
      if (lists) {
        for (const bool ends : {true, false}) {
          text.require_line("its cells");
          if (text.word("keyword") != (ends ? "OFFSETS" : "CONNECTIVITY"))
            text.fail("OFFSETS and CONNECTIVITY belong here");
          (ends ? cells.ends : cells.corners) = read(ends ? count : size, std::string(text.word("type")), "cell");
        }
        if (cells.ends.empty() || cells.ends[0] != 0) text.fail("offsets do not begin with 0");
        cells.ends.erase(cells.ends.begin());
      } else {
        const Numbers numbers = read(size, "int", "cell");
        std::size_t at = 0;
        while (at < size && numbers[at] >= 0 && numbers[at] < double(size - at)) {
          const std::size_t corners = std::size_t(numbers[at]);
          for (std::size_t k = 1; k <= corners; ++k) cells.corners.push_back(numbers[at + k]);
          cells.ends.push_back(double(cells.corners.size())), at += corners + 1;
        }
        if (at != size || cells.ends.size() != count)
          text.fail(fmt::format("{} cells declared, {} found in {} numbers", count, cells.ends.size(), size));
      }
    } else if (keyword == "CELL_TYPES") {
      cells.types = read(text.count("number of types"), "int", "type of a cell");
    } else if (keyword == "POINT_DATA" || keyword == "CELL_DATA") {
      break;
    } else if (order == Order::text && !std::isalpha(static_cast<unsigned char>(keyword[0]))) {
      text.fail("line has more numbers than are declared");
    }
  }
  if (!grid) refuse("file holds no unstructured grid", file);
  // What is left of a "10" or "24" would be another type, whose cells are passed over.
  const double last = cells.types.empty() ? 0 : cells.types.back();
  if (order == Order::text && !text.bytes().ends_with('\n') && (last == 1 || last == 2 || last == 7))
    refuse("file ends within its last number", file);
  TetMesh mesh;
  add_tets(mesh, cells, file);
  return mesh;
}

}  // namespace tetpbd
