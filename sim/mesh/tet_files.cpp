#include <fmt/format.h>

#include <algorithm>

#include "sim/error.h"
#include "sim/files.h"
#include "sim/mesh/formats.h"
#include "sim/mesh/text_file.h"
#include "sim/mesh/weld.h"

namespace tetpbd {
namespace {

constexpr long long tet_type = 4, second_order_tet_type = 11;

// Gmsh's .msh, ASCII, versions 2.2 and 4.1: from 4 on, nodes and elements stand in blocks.
struct MshReader {
  TextFile text;
  bool blocks = false;
  TetMesh mesh;
  // Node tags are any positive numbers. Sorted, not hashed: no choice of tags makes it slow.
  std::vector<std::pair<long long, std::uint32_t>> index_of;

  void read_tag() { index_of.emplace_back(text.integer("node number"), std::uint32_t(index_of.size())); }

  void read_nodes() {
    text.require_line("the number of nodes");
    const std::size_t block_count = blocks ? text.count("number of node blocks", 8) : 1;
    const std::size_t total = text.count("number of nodes", 8);
    for (std::size_t b = 0; b < block_count; ++b) {
      std::size_t count = total;
      if (blocks) {
        text.require_line("its last node block");
        for (const char* name : {"dimension", "entity", "parametric flag"}) text.integer(name);
        count = text.count("number of nodes in the block", 8);
      }
      for (std::size_t i = 0; blocks && i < count; ++i) {
        text.require_line("its last node number");
        read_tag();
      }
      for (std::size_t i = 0; i < count; ++i) {
        text.require_line("its last node");
        if (!blocks) read_tag();
        mesh.positions.push_back(text.position());
      }
    }
    if (mesh.positions.size() != total)
      text.fail(fmt::format("{} nodes declared, {} found", total, mesh.positions.size()));
    std::ranges::sort(index_of);
    const auto twice = std::ranges::adjacent_find(index_of, {}, [](const auto& node) { return node.first; });
    if (twice != index_of.end()) text.fail(fmt::format("node {} appears twice", twice->first));
  }

  void read_elements() {
    text.require_line("the number of elements");
    const std::size_t block_count = blocks ? text.count("number of element blocks", 8) : 1;
    std::size_t count = blocks ? 0 : text.count("number of elements", 6);
    for (std::size_t b = 0; b < block_count; ++b) {
      long long type = 0;
      if (blocks) {
        text.require_line("its last element block");
        for (const char* name : {"dimension", "entity"}) text.integer(name);
        type = text.integer("element type");
        count = text.count("number of elements in the block", 4);
      }
      for (std::size_t i = 0; i < count; ++i) {
        text.require_line("its last element");
        text.integer("element number");
        if (!blocks) type = text.integer("element type");
        if (type != tet_type && type != second_order_tet_type) continue;
        for (std::size_t tags = blocks ? 0 : text.count("number of tags"); tags > 0; --tags)
          text.integer("tag");
        read_tet();
      }
    }
  }

  void read_tet() {
    Tet tet;
    for (std::uint32_t& v : tet) {
      const long long tag = text.integer("node of the tet");
      const auto found = std::ranges::lower_bound(index_of, std::pair(tag, 0u));
      if (found == index_of.end() || found->first != tag)
        text.fail(fmt::format("element names node {}, which is not there", tag));
      v = found->second;
    }
    mesh.tets.push_back(tet);
  }
};

TetMesh read_msh(const std::filesystem::path& file) {
  MshReader reader{TextFile(file), false, {}, {}};
  TextFile& text = reader.text;
  bool has_nodes = false, has_elements = false;
  if (!text.next_line() || text.line() != "$MeshFormat")
    text.fail("file does not begin with $MeshFormat, so it is not Gmsh's .msh");
  text.require_line("its format");
  const std::string version(text.word("version"));
  if (text.integer("file type") != 0)
    throw Error("binary .msh is not supported", file.string(),
                "save it as ASCII (gmsh -bin 0, version 2.2 or 4.1)");
  if (version != "2.2" && version != "2.0" && version != "2" && version != "2.1" && version != "4.1")
    throw Error(fmt::format(".msh version {} is not supported", version.substr(0, 40)), file.string(),
                "save it as version 2.2 or 4.1");
  reader.blocks = version == "4.1";
  while (text.next_line()) {
    if (text.line() == "$Nodes") {
      if (has_nodes) text.fail("file has $Nodes twice");
      has_nodes = true;
      reader.read_nodes();
    } else if (text.line() == "$Elements") {
      has_elements = true;
      reader.read_elements();
    }
  }
  if (!has_nodes || !has_elements)
    throw Error(has_nodes ? "file has no $Elements" : "file has no $Nodes", file.string(),
                "it is incomplete: export it again");
  return std::move(reader.mesh);
}

// Version 2.2; two tags: physical and elementary entity, as Gmsh itself requires.
std::string msh_text(const TetMesh& mesh) {
  std::string text = fmt::format("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{}\n", mesh.positions.size());
  put_rows(text, mesh.positions, "", 0, 1);
  text += fmt::format("$EndNodes\n$Elements\n{}\n", mesh.tets.size());
  put_rows(text, mesh.tets, "4 2 1 1 ", 1, 1);
  return text + "$EndElements\n";
}

bool is_tet_file(const std::filesystem::path& file) {
  const std::string extension = lower_extension(file);
  return extension == ".node" || extension == ".ele" || extension == ".msh";
}

}  // namespace

// TetGen's pair: the .node file's first number says whether both count from 0 or from 1.
TetMesh read_node_ele(const std::filesystem::path& file) {
  std::filesystem::path node_file = file, ele_file = file;
  node_file.replace_extension(file.extension() == ".NODE" || file.extension() == ".ELE" ? ".NODE" : ".node");
  ele_file.replace_extension(file.extension() == ".NODE" || file.extension() == ".ELE" ? ".ELE" : ".ele");
  TetMesh mesh;
  long long base = 0;
  {
    TextFile nodes(node_file, '#');
    nodes.require_line("the number of nodes");
    const std::size_t count = nodes.count("number of nodes", 8);
    if (nodes.integer("dimension") != 3) nodes.fail("nodes are not three-dimensional");
    mesh.positions.reserve(count);
    for (std::size_t i = 0; i < count; ++i) {
      nodes.require_line("its last node");
      const long long number = nodes.integer("node number");
      if (i == 0) {
        base = number;
        if (base != 0 && base != 1) nodes.fail(fmt::format("first node is {}, neither 0 nor 1", number));
      }
      if (number != base + static_cast<long long>(i))
        nodes.fail(fmt::format("node {} stands where {} should", number, base + static_cast<long long>(i)));
      mesh.positions.push_back(nodes.position());
    }
  }
  TextFile elements(ele_file, '#');
  elements.require_line("the number of tets");
  const std::size_t count = elements.count("number of tets", 10);
  const long long corners = elements.integer("nodes per tet");
  if (corners != 4 && corners != 10)
    elements.fail(fmt::format("{} nodes per tet, neither 4 nor 10", corners));
  mesh.tets.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    elements.require_line("its last tet");
    elements.integer("tet number");
    Tet tet;
    for (std::uint32_t& v : tet) {
      const long long number = elements.integer("node of the tet");
      if (number < base || number - base >= static_cast<long long>(mesh.positions.size()))
        elements.fail(fmt::format("tet names node {}, outside {} .. {}", number, base,
                                  base + static_cast<long long>(mesh.positions.size()) - 1));
      v = std::uint32_t(number - base);
    }
    mesh.tets.push_back(tet);
  }
  return mesh;
}

bool is_surface_file(const std::filesystem::path& file) {
  const std::string extension = lower_extension(file);
  return extension == ".ply" || extension == ".obj" || extension == ".stl" || extension == ".off";
}

TetMesh load_tets(const std::filesystem::path& file) {
  if (!is_tet_file(file))
    throw Error("not a tetrahedral mesh format", file.string(), "use .node with .ele, or .msh");
  TetMesh mesh = lower_extension(file) == ".msh" ? read_msh(file) : read_node_ele(file);
  finish_tets(mesh, file.string());
  return mesh;
}

TetMesh load_mesh(const std::filesystem::path& file, const std::string& switches) {
  if (is_surface_file(file)) return tetrahedralise(load_surface(file), switches, 600, file.string());
  if (is_tet_file(file)) return load_tets(file);
  require_readable(file);  // a missing file or a folder is the better news
  throw Error(fmt::format("unknown mesh format '{}'", lower_extension(file)), file.string(),
              "use a surface (.ply .obj .stl .off) or tetrahedra (.node/.ele .msh)");
}

void require_mesh_format(const std::filesystem::path& file) {
  if (!is_surface_file(file) && !is_tet_file(file))
    throw Error(fmt::format("unknown mesh format '{}'", lower_extension(file)), file.string(),
                "use .node, .ele or .msh for tetrahedra, .ply, .obj, .off or .stl for the boundary surface");
}

void write_mesh(const std::filesystem::path& file, const TetMesh& mesh) {
  require_mesh_format(file);
  const std::string extension = lower_extension(file);
  if (extension == ".msh") return write_whole(file, msh_text(mesh));
  if (is_surface_file(file)) {
    SurfaceMesh surface{mesh.positions, mesh.surface};
    drop_unused_vertices(surface.positions, surface.triangles);
    return write_whole(file, surface_bytes(surface, extension));
  }
  std::string nodes = fmt::format("{} 3 0 0\n", mesh.positions.size());
  put_rows(nodes, mesh.positions, "", 0, 0);
  std::string elements = fmt::format("{} 4 0\n", mesh.tets.size());
  put_rows(elements, mesh.tets, "", 0, 0);
  std::filesystem::path node_file = file, element_file = file;
  write_whole(
      {{node_file.replace_extension(".node"), nodes}, {element_file.replace_extension(".ele"), elements}});
}

}  // namespace tetpbd
