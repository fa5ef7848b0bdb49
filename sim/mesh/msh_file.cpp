#include "sim/mesh/msh_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>

#include "sim/error.h"
#include "sim/mesh/text_file.h"

namespace tetpbd {
namespace {

constexpr long long tet_type = 4, second_order_tet_type = 11;
constexpr std::size_t any = static_cast<std::size_t>(1) << 40;

struct Reader {
  TextFile text;
  TetMesh mesh;
  // Node tags are any positive numbers. Sorted, not hashed: no choice of tags makes it slow.
  std::vector<std::pair<long long, std::uint32_t>> index_of;

  void add_node(long long tag, const glm::dvec3& position) {
    index_of.emplace_back(tag, static_cast<std::uint32_t>(mesh.positions.size()));
    mesh.positions.push_back(position);
  }

  void sort_nodes() {
    std::sort(index_of.begin(), index_of.end());
    const auto twice = std::adjacent_find(index_of.begin(), index_of.end(),
                                          [](const auto& a, const auto& b) { return a.first == b.first; });
    if (twice != index_of.end()) text.fail(fmt::format("node {} appears twice", twice->first));
  }

  glm::dvec3 read_position() {
    const double x = text.number("x"), y = text.number("y"), z = text.number("z");
    return {x, y, z};
  }

  void add_tet() {
    Tet tet;
    for (std::uint32_t& v : tet) {
      const long long tag = text.integer("node of the tet");
      const auto found = std::lower_bound(index_of.begin(), index_of.end(), std::pair(tag, std::uint32_t{0}));
      if (found == index_of.end() || found->first != tag)
        text.fail(fmt::format("element names node {}, which is not there", tag));
      v = found->second;
    }
    mesh.tets.push_back(tet);
  }

  void read_nodes_2() {
    text.require_line("the number of nodes");
    const std::size_t count = text.count_fitting("number of nodes", 8);
    for (std::size_t i = 0; i < count; ++i) {
      text.require_line("its last node");
      const long long tag = text.integer("node number");
      add_node(tag, read_position());
    }
  }

  void read_elements_2() {
    text.require_line("the number of elements");
    const std::size_t count = text.count_fitting("number of elements", 6);
    for (std::size_t i = 0; i < count; ++i) {
      text.require_line("its last element");
      text.integer("element number");
      const long long type = text.integer("element type");
      if (type != tet_type && type != second_order_tet_type) continue;
      const std::size_t tags = text.count("number of tags", 1000);
      for (std::size_t k = 0; k < tags; ++k) text.integer("tag");
      add_tet();
    }
  }

  void read_nodes_4() {
    text.require_line("the number of node blocks");
    const std::size_t blocks = text.count_fitting("number of node blocks", 8);
    const std::size_t total = text.count_fitting("number of nodes", 8);
    std::vector<long long> tags;
    for (std::size_t b = 0; b < blocks; ++b) {
      text.require_line("its last node block");
      text.integer("dimension");
      text.integer("entity");
      text.integer("parametric flag");
      tags.resize(text.count_fitting("number of nodes in the block", 8));
      for (long long& tag : tags) {
        text.require_line("its last node number");
        tag = text.integer("node number");
      }
      for (const long long tag : tags) {
        text.require_line("its last node");
        add_node(tag, read_position());
      }
    }
    if (mesh.positions.size() != total)
      text.fail(fmt::format("{} nodes claimed, {} found", total, mesh.positions.size()));
  }

  void read_elements_4() {
    text.require_line("the number of element blocks");
    const std::size_t blocks = text.count_fitting("number of element blocks", 8);
    for (std::size_t b = 0; b < blocks; ++b) {
      text.require_line("its last element block");
      text.integer("dimension");
      text.integer("entity");
      const long long type = text.integer("element type");
      const std::size_t count = text.count_fitting("number of elements in the block", 4);
      for (std::size_t i = 0; i < count; ++i) {
        text.require_line("its last element");
        if (type != tet_type && type != second_order_tet_type) continue;
        text.integer("element number");
        add_tet();
      }
    }
  }
};

}  // namespace

TetMesh read_msh(const std::filesystem::path& file) {
  Reader reader{TextFile(file, '\0'), {}, {}};
  TextFile& text = reader.text;
  double version = 0;
  bool has_nodes = false, has_elements = false;
  while (text.next_line()) {
    const std::string section(text.line());
    if (!section.starts_with('$')) {
      if (version == 0) text.fail("file does not begin with $MeshFormat, so it is not Gmsh's .msh");
      continue;
    }
    if (section == "$MeshFormat") {
      text.require_line("its format");
      version = text.number("version");
      if (text.count("file type", any) != 0)
        throw Error("binary .msh is not supported", file.string(),
                    "save it as ASCII (gmsh -bin 0, version 2.2 or 4.1)");
      if (version != 2.2 && version != 2.0 && version != 2.1 && version != 4.1)
        throw Error(fmt::format(".msh version {} is not supported", version), file.string(),
                    "save it as version 2.2 or 4.1");
    } else if (version == 0) {
      text.fail("file does not begin with $MeshFormat, so it is not Gmsh's .msh");
    } else if (section == "$Nodes") {
      if (has_nodes) text.fail("file has $Nodes twice");
      has_nodes = true;
      version < 4 ? reader.read_nodes_2() : reader.read_nodes_4();
      reader.sort_nodes();
    } else if (section == "$Elements") {
      has_elements = true;
      version < 4 ? reader.read_elements_2() : reader.read_elements_4();
    }
  }
  if (!has_nodes || !has_elements)
    throw Error(has_nodes ? "file has no $Elements" : "file has no $Nodes", file.string(),
                "it is incomplete: export it again");
  return std::move(reader.mesh);
}

std::string msh_text(const TetMesh& mesh) {
  fmt::memory_buffer text;
  const auto out = std::back_inserter(text);
  fmt::format_to(out, "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{}\n", mesh.positions.size());
  for (std::size_t v = 0; v < mesh.positions.size(); ++v)
    fmt::format_to(out, "{} {} {} {}\n", v + 1, mesh.positions[v].x, mesh.positions[v].y,
                   mesh.positions[v].z);
  fmt::format_to(out, "$EndNodes\n$Elements\n{}\n", mesh.tets.size());
  for (std::size_t i = 0; i < mesh.tets.size(); ++i) {
    const Tet& t = mesh.tets[i];  // two tags: physical and elementary entity, as Gmsh itself requires
    fmt::format_to(out, "{} 4 2 1 1 {} {} {} {}\n", i + 1, t[0] + 1, t[1] + 1, t[2] + 1, t[3] + 1);
  }
  fmt::format_to(out, "$EndElements\n");
  return fmt::to_string(text);
}

}  // namespace tetpbd
