#include <fmt/format.h>

#include <unordered_map>

#include "sim/error.h"
#include "sim/mesh/tet_mesh.h"
#include "sim/mesh/text_file.h"

namespace tetpbd {
namespace {

namespace fs = std::filesystem;

// Whether nodes and elements are in blocks, as in version 4.1 of Gmsh's .msh; in version 2 they are not.
bool read_msh_format(TextFile& text, const fs::path& file) {
  if (!text.next_line() || text.line() != "$MeshFormat")
    text.fail("file does not begin with $MeshFormat, so it is not Gmsh's .msh");
  text.require_line("its format");
  const std::string version(text.word("version"));
  if (text.integer("file type") != 0)
    throw Error("binary .msh is not supported", file.string(), "save it as ASCII (gmsh -bin 0, version 2.2 or 4.1)");
  const bool blocks = version == "4.1";
  if (!blocks && version != "2" && !version.starts_with("2."))
    throw Error(fmt::format(".msh version {} is not supported", version.substr(0, 40)), file.string(),
                "save it as version 2.2 or 4.1");
  return blocks;
}

TetMesh read_msh(const fs::path& file) {
  TextFile text(file);
  const bool blocks = read_msh_format(text, file);
  TetMesh mesh;
  std::unordered_map<long long, std::uint32_t> indices;  // by a node's number, which can be any
  const auto read_number = [&] {
    const long long number = text.integer("node number");
    if (!indices.try_emplace(number, std::uint32_t(indices.size())).second)
      text.fail(fmt::format("node {} appears twice", number));
  };
  const auto read_position = [&] { mesh.positions.push_back(text.position()); };
  const auto read_nodes = [&] {
    text.require_line("the number of nodes");
    const std::size_t block_count = blocks ? text.count("number of node blocks") : 0;
    const std::size_t total = text.count("number of nodes");
    text.lines(block_count, "node block", [&] {
      for (const char* name : {"dimension", "entity", "parametric flag"}) text.integer(name);
      const std::size_t count = text.count("number of nodes in the block");
      text.lines(count, "node number", read_number);
      text.lines(count, "node", read_position);
    });
    text.lines(blocks ? 0 : total, "node", [&] { read_number(), read_position(); });
    if (mesh.positions.size() != total)
      text.fail(fmt::format("{} nodes declared, {} found", total, mesh.positions.size()));
  };
  // Reads what follows an element's number and type: 4 is a tet, 11 one of second order, whose corners come first.
  const auto read_element = [&](long long type) {
    if (type != 4 && type != 11) return;
    for (std::size_t tags = blocks ? 0 : text.count("number of tags"); tags > 0; --tags) text.integer("tag");
    for (std::uint32_t& v : mesh.tets.emplace_back()) {
      const long long number = text.integer("node of the tet");
      const auto found = indices.find(number);
      if (found == indices.end()) text.fail(fmt::format("element names node {}, which is not there", number));
      v = found->second;
    }
  };
  const auto read_elements = [&] {
    text.require_line("the number of elements");
    const std::size_t count = text.count(blocks ? "number of element blocks" : "number of elements");
    text.lines(blocks ? count : 0, "element block", [&] {
      for (const char* name : {"dimension", "entity"}) text.integer(name);
      const long long type = text.integer("element type");
      text.lines(text.count("number of elements in the block"), "element", [&] {
        text.integer("element number");
        read_element(type);
      });
    });
    text.lines(blocks ? 0 : count, "element", [&] {
      text.integer("element number");
      read_element(text.integer("element type"));
    });
  };

  while (text.next_line())
    if (text.line() == "$Nodes")
      read_nodes();
    else if (text.line() == "$Elements")
      read_elements();
  return mesh;
}

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
  if (nodes.integer("dimension") != 3) nodes.fail("nodes are not three-dimensional");
  nodes.lines(node_count, "node", [&] {
    const long long number = nodes.integer("node number"), index = std::ssize(mesh.positions);
    if (index == 0) base = number;
    if (base != 0 && base != 1) nodes.fail(fmt::format("first node is {}, neither 0 nor 1", number));
    if (number != base + index) nodes.fail(fmt::format("node {} stands where {} should", number, base + index));
    mesh.positions.push_back(nodes.position());
  });
  TextFile elements(named(".ele"), '#');
  elements.require_line("the number of tets");
  const std::size_t tet_count = elements.count("number of tets");
  const long long corners = elements.integer("nodes per tet"), last = base + std::ssize(mesh.positions) - 1;
  if (corners != 4 && corners != 10) elements.fail(fmt::format("{} nodes per tet, neither 4 nor 10", corners));
  elements.lines(tet_count, "tet", [&] {
    elements.integer("tet number");
    for (std::uint32_t& v : mesh.tets.emplace_back()) {
      const long long number = elements.integer("node of the tet");
      if (number < base || number > last)
        elements.fail(fmt::format("tet names node {}, outside {} .. {}", number, base, last));
      v = std::uint32_t(number - base);
    }
  });
  return mesh;
}

TetMesh load_tets(const fs::path& file) {
  TetMesh mesh = lower_extension(file) == ".msh" ? read_msh(file) : read_node_ele(file);
  finish_tets(mesh, file.string());
  return mesh;
}

TetMesh load_mesh(const fs::path& file, const std::string& switches) {
  require_readable(file);
  require_mesh_format(file);
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
