#include <fmt/format.h>

#include <algorithm>
#include <unordered_map>
#include <utility>

#include "sim/error.h"
#include "sim/mesh/tet_mesh.h"
#include "sim/mesh/text_file.h"

namespace tetpbd {
namespace {

namespace fs = std::filesystem;

// Nodes of an element by its type, 0 where there is no such type; what fills no volume has to be passed over too.
constexpr std::uint8_t msh_nodes[] = {0, 2,  3,  4,  4, 8,  6,  5,  3,  6,  9, 10, 27, 18, 14, 1,
                                      8, 20, 15, 13, 9, 10, 12, 15, 15, 21, 4, 5,  6,  20, 35, 56};

// Whether nodes and elements are in blocks, as in version 4.1 of Gmsh's .msh; in version 2 they are not. What is in
// bytes begins with a one of four bytes, which tells their order.
bool read_msh_format(TextFile& text, const fs::path& file, Order& order) {
  if (!text.next_line() || text.line() != "$MeshFormat")
    text.fail("file does not begin with $MeshFormat, so it is not Gmsh's .msh");
  text.require_line("its format");
  const std::string version(text.word("version"));
  const bool bytes = text.integer("file type") != 0, blocks = version == "4.1";
  if (!blocks && version != "2" && !version.starts_with("2."))
    throw Error(fmt::format(".msh version {} is not supported", version.substr(0, 40)), file.string(),
                "save it as version 2.2 or 4.1");
  if (!bytes) return blocks;
  if (text.integer("size of numbers") != 8) text.fail("binary numbers are not of 8 bytes");
  const std::string_view one = text.take(4, "byte of its format");
  order = one[0] == 1 ? Order::little : Order::big;
  if (value_of<std::int32_t>(one.data(), order) != 1) text.fail("binary file does not say the order of its bytes");
  return blocks;
}

TetMesh read_msh(const fs::path& file) {
  TextFile text(file);
  Order order = Order::text;
  const bool blocks = read_msh_format(text, file, order), bytes = order != Order::text;
  TetMesh mesh;
  std::unordered_map<long long, std::uint32_t> indices;  // by a node's number, which can be any
  std::unordered_map<long long, std::int32_t> groups;    // by a volume's number
  const auto whole = [&](const char* name) {
    return blocks ? text.whole<std::int64_t>(name) : text.whole<std::int32_t>(name);
  };
  const auto count = [&](const char* name) { return text.counted(whole(name), name); };
  // The numbers of blocks and of all; version 2 has the latter alone, as text in any case.
  const auto read_counts = [&](const char* name) {
    if (blocks) text.set_order(order);
    if (!blocks || !bytes) text.require_line(name);
    const std::size_t block_count = blocks ? count("number of blocks") : 0, total = count(name);
    if (!blocks && text.more()) text.fail(fmt::format("line has more than the {}, which may be missing", name));
    if (blocks) whole("least number"), whole("largest number");
    text.set_order(order);
    return std::pair(block_count, total);
  };
  const auto end_section = [&](const char* end, const char* what, std::size_t total, std::size_t found) {
    if (found != total) text.fail(fmt::format("{} {} declared, {} found", total, what, found));
    text.set_order(Order::text);
    if (!text.next_line() || text.line() != end)
      text.fail(fmt::format("{} {} declared, but no {} follows", total, what, end));
  };
  const auto read_number = [&] {
    const long long number = whole("node number");
    if (!indices.try_emplace(number, std::uint32_t(indices.size())).second)
      text.fail(fmt::format("node {} appears twice", number));
  };
  const auto read_position = [&](std::size_t parameters) {
    if (!bytes) return mesh.positions.push_back(text.position());
    mesh.positions.push_back(text.any_position("node"));
    text.take(8 * parameters, "node");
  };
  // Of the volumes, the first physical group that each belongs to; the others are passed over.
  const auto read_entities = [&] {
    text.set_order(order);
    if (!bytes) text.require_line("numbers of entities");
    std::array<std::size_t, 4> counts;
    for (std::size_t& here : counts) here = count("number of entities");
    for (std::size_t dimension = 0; dimension < 4; ++dimension)
      text.lines(counts[dimension], "entity", [&] {
        const auto entity = text.whole<std::int32_t>("entity");
        for (int k = dimension == 0 ? 3 : 6; k > 0; --k) text.number_of(real, "bound of an entity");
        for (std::size_t k = count("number of groups"), first = k; k > 0; --k)
          if (const auto group = text.whole<std::int32_t>("group"); dimension == 3 && k == first)
            groups[entity] = std::int32_t(group);
        for (std::size_t k = dimension > 0 ? count("number of entities around it") : 0; k > 0; --k)
          text.whole<std::int32_t>("entity around it");
      });
    text.set_order(Order::text);
    if (!text.next_line() || text.line() != "$EndEntities") text.fail("$EndEntities does not follow the entities");
  };
  const auto read_nodes = [&] {
    const auto [block_count, total] = read_counts("number of nodes");
    text.lines(block_count, "node block", [&] {
      const long long dimension = text.whole<std::int32_t>("dimension");
      text.whole<std::int32_t>("entity");
      const bool parametric = text.whole<std::int32_t>("parametric flag") != 0;
      const std::size_t here = count("number of nodes in the block");
      text.lines(here, "node number", read_number);
      text.lines(here, "node",
                 [&] { read_position(parametric && dimension > 0 && dimension < 4 ? std::size_t(dimension) : 0); });
    });
    text.lines(blocks ? 0 : total, "node", [&] { read_number(), read_position(0); });
    end_section("$EndNodes", "nodes", total, mesh.positions.size());
  };
  const auto read_elements = [&] {
    const auto [block_count, total] = read_counts("number of elements");
    std::size_t found = 0, tags = 0;
    long long type = 0;
    std::int32_t group = 0;  // the physical group; of version 4 that of the block's volume
    // Tets of any order have their corners first. Other solids are hexahedra, prisms and pyramids, of any order.
    const auto is_one_of = [&](auto... types) { return ((type == types) || ...); };
    const auto read_element = [&] {
      whole("element number");
      if (!blocks && !bytes) type = whole("element type"), tags = count("number of tags");
      if (bytes && (type < 1 || type >= std::ssize(msh_nodes)))
        text.fail(fmt::format("there is no element type {}", type));
      for (std::size_t i = 0; i < tags; ++i) {
        const long long tag = whole("tag");
        if (i == 0) group = std::int32_t(tag);
      }
      const std::size_t corners = is_one_of(4, 11, 29, 30, 31) ? 4 : 0;
      mesh.other_cells += is_one_of(5, 6, 7, 12, 13, 14, 17, 18, 19, 92, 93);
      if (corners > 0) mesh.tags.push_back(group);
      if (corners > 0)
        for (std::uint32_t& v : mesh.tets.emplace_back()) {
          const long long number = whole("node of the tet");
          const auto node = indices.find(number);
          if (node == indices.end()) text.fail(fmt::format("element names node {}, which is not there", number));
          v = node->second;
        }
      if (bytes) text.take((msh_nodes[type] - corners) * (blocks ? 8 : 4), "element");
      ++found;
    };
    const auto read_block = [&] {
      if (blocks) {
        const bool solid = text.whole<std::int32_t>("dimension") == 3;
        const auto found_group = groups.find(text.whole<std::int32_t>("entity"));
        group = solid && found_group != groups.end() ? found_group->second : 0;
      }
      type = text.whole<std::int32_t>("element type");
      const std::size_t here = count("number of elements in the block");
      if (!blocks) tags = count("number of tags");
      text.lines(here, "element", read_element);
    };
    text.lines(block_count, "element block", read_block);
    if (!blocks && !bytes) text.lines(total, "element", read_element);
    while (!blocks && found < total) read_block();
    end_section("$EndElements", "elements", total, found);
  };

  while (text.next_line())
    if (text.line() == "$Entities" && blocks)
      read_entities();
    else if (text.line() == "$Nodes")
      read_nodes();
    else if (text.line() == "$Elements")
      read_elements();
  return mesh;
}

// Medit: numbers and keywords one after the other, wherever lines end. Of what is not read, every word is passed over.
TetMesh read_medit(const fs::path& file) {
  TextFile text(file, '#');
  if (!text.next_line() || !text.line().starts_with("MeshVersionFormatted"))
    text.fail("file does not begin with MeshVersionFormatted, so it is not Medit's .mesh in ASCII");
  constexpr std::string_view other_solids[] = {"Hexahedra", "HexahedraQ2", "Prisms",    "PrismsP2",
                                               "Pyramids",  "PyramidsP2",  "Pentahedra"};
  TetMesh mesh;
  const auto next_word = [&] { return text.more() || text.next_line(); };
  const auto whole = [&](const char* name) {
    if (!next_word()) text.fail(fmt::format("file ends before its last {}", name));
    return text.integer(name);
  };
  for (bool counted = false; next_word();) {
    const std::string keyword(text.word("keyword"));
    if (counted && !std::isalpha(static_cast<unsigned char>(keyword[0]))) text.fail("more follow than are declared");
    counted = keyword == "Vertices" || keyword.starts_with("Tetrahedra");
    if (keyword == "Dimension" && whole("dimension") != 3) text.fail("vertices are not three-dimensional");
    if (keyword == "Vertices")
      for (std::size_t left = text.counted(whole("number of vertices"), "number of vertices"); left > 0; --left) {
        mesh.positions.push_back(text.any_position("vertex"));
        whole("vertex");  // its reference
      }
    if (std::ranges::find(other_solids, keyword) != std::end(other_solids))
      mesh.other_cells += text.counted(whole("number of cells"), "number of cells");
    if (keyword != "Tetrahedra" && keyword != "TetrahedraP2") continue;
    for (std::size_t left = text.counted(whole("number of tets"), "number of tets"); left > 0; --left) {
      for (std::uint32_t& v : mesh.tets.emplace_back()) {
        const long long number = whole("tet");
        if (number < 1 || number > std::ssize(mesh.positions))
          text.fail(fmt::format("tet names vertex {}, outside 1 .. {}", number, mesh.positions.size()));
        v = std::uint32_t(number - 1);
      }
      for (int other = keyword == "Tetrahedra" ? 0 : 6; other > 0; --other) whole("tet");  // edges' vertices
      mesh.tags.push_back(std::int32_t(whole("reference of a tet")));
    }
  }
  return mesh;
}

constexpr std::pair<const char*, TetMesh (*)(const fs::path&)> readers[] = {
    {".node", read_node_ele}, {".ele", read_node_ele}, {".msh", read_msh},
    {".mesh", read_medit},    {".vtk", read_vtk},      {".vtu", read_vtu}};

}  // namespace

// The .node file's first number says whether both files count from 0 or from 1.
TetMesh read_node_ele(const fs::path& file) {
  const auto named = [&](const char* extension) {
    return lower_extension(file) == extension ? file : fs::path(file).replace_extension(extension);
  };
  TetMesh mesh;
  long long base = 0;
  TextFile nodes(named(".node"), '#');
  nodes.require_line("the number of nodes");
  const std::size_t node_count = nodes.count("number of nodes");
  if (nodes.more() && nodes.integer("dimension") != 3) nodes.fail("nodes are not three-dimensional");
  nodes.lines(node_count, "node", [&] {
    const long long number = nodes.integer("node number"), index = std::ssize(mesh.positions);
    if (index == 0) base = number;
    if (base != 0 && base != 1) nodes.fail(fmt::format("first node is {}, neither 0 nor 1", number));
    if (number != base + index) nodes.fail(fmt::format("node {} stands where {} should", number, base + index));
    mesh.positions.push_back(nodes.position());
  });
  if (nodes.next_line()) nodes.fail(fmt::format("{} nodes declared, more follow", node_count));
  TextFile elements(named(".ele"), '#');
  elements.require_line("the number of tets");
  const std::size_t tet_count = elements.count("number of tets");
  const long long corners = elements.more() ? elements.integer("nodes per tet") : 4,
                  last = base + std::ssize(mesh.positions) - 1;
  const bool attributes = elements.more() && elements.integer("number of attributes") > 0;
  if (corners != 4 && corners != 10) elements.fail(fmt::format("{} nodes per tet, neither 4 nor 10", corners));
  elements.lines(tet_count, "tet", [&] {
    elements.integer("tet number");
    for (std::uint32_t& v : mesh.tets.emplace_back()) {
      const long long number = elements.integer("node of the tet");
      if (number < base || number > last)
        elements.fail(fmt::format("tet names node {}, outside {} .. {}", number, base, last));
      v = std::uint32_t(number - base);
    }
    for (long long k = corners; k > 4; --k) elements.integer("node of the tet");
    if (attributes) mesh.tags.push_back(std::int32_t(elements.number("attribute")));
  });
  if (elements.next_line()) elements.fail(fmt::format("{} tets declared, more follow", tet_count));
  return mesh;
}

TetMesh load_tets(const fs::path& file) {
  const std::string extension = lower_extension(file);
  const auto reader =
      std::ranges::find(readers, extension, [](const auto& row) { return std::string_view(row.first); });
  if (extension == ".meshb")
    throw Error("Medit's binary format is not read", file.string(), "save it as .mesh, which is text, or as .msh");
  if (reader == std::end(readers))
    throw Error(fmt::format("unknown mesh format '{}'", extension), file.string(), fmt::format("use {}", mesh_formats));
  TetMesh mesh = reader->second(file);
  if (mesh.tets.empty() && mesh.other_cells > 0)
    throw Error(fmt::format("all {} solid cells are hexahedra, prisms or the like", mesh.other_cells), file.string(),
                "mesh it with tetrahedra, or give its boundary alone (.stl, .ply), which is filled");
  finish_tets(mesh, file.string());
  return mesh;
}

TetMesh load_mesh(const fs::path& file, const std::string& switches) {
  require_readable(file);
  if (!is_surface_file(file)) return load_tets(file);
  return tetrahedralise(load_surface(file), switches, 600, file.string());
}

void require_mesh_format(const fs::path& file) {
  const std::string extension = lower_extension(file);
  if (extension != ".node" && extension != ".ele" && extension != ".msh" && !is_surface_file(file))
    throw Error(fmt::format("unknown mesh format '{}'", extension), file.string(),
                "use .ply, .obj, .stl or .off for surfaces, .node with .ele or .msh for tetrahedra");
}

}  // namespace tetpbd
