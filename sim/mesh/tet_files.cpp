#include <fmt/format.h>

#include "sim/error.h"
#include "sim/mesh/mesh_cache.h"
#include "sim/mesh/msh_file.h"
#include "sim/mesh/tet_mesh.h"
#include "sim/mesh/tetgen_switches.h"
#include "sim/mesh/text_file.h"

namespace tetpbd {
namespace {

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
    const std::size_t count = nodes.count_fitting("number of nodes", 8);
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
      const double x = nodes.number("x"), y = nodes.number("y"), z = nodes.number("z");
      mesh.positions.emplace_back(x, y, z);
    }
  }
  TextFile elements(ele_file, '#');
  elements.require_line("the number of tets");
  const std::size_t count = elements.count_fitting("number of tets", 10);
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
      v = static_cast<std::uint32_t>(number - base);
    }
    mesh.tets.push_back(tet);
  }
  return mesh;
}

}  // namespace

bool is_surface_file(const std::filesystem::path& file) {
  const std::string extension = lower_extension(file);
  return extension == ".ply" || extension == ".obj" || extension == ".stl" || extension == ".off";
}

TetMesh load_tets(const std::filesystem::path& file) {
  const std::string extension = lower_extension(file);
  TetMesh mesh;
  if (extension == ".msh")
    mesh = read_msh(file);
  else if (extension == ".node" || extension == ".ele")
    mesh = read_node_ele(file);
  else
    throw Error("not a tetrahedral mesh format", file.string(), "use .node with .ele, or .msh");
  finish_tets(mesh, file.string());
  return mesh;
}

namespace {

TetMesh fill_file(const std::filesystem::path& file, const std::string& switches) {
#if TETPBD_TETGEN
  const std::optional<CacheKey> source = source_key(file, switches);
  if (source)
    if (std::optional<TetMesh> kept = read_mesh_of(*source)) return std::move(*kept);
  const SurfaceMesh surface = load_surface(file);
  TetMesh mesh = tetrahedralise(surface, switches, 600, file.string());
  if (source && source == source_key(file, switches))  // nobody wrote it in between
    keep_source(*source, mesh_key(surface, checked_switches(switches)));
  return mesh;
#else
  return tetrahedralise(load_surface(file), switches, 600, file.string());
#endif
}

}  // namespace

TetMesh load_mesh(const std::filesystem::path& file, const std::string& switches) {
  if (is_surface_file(file)) return fill_file(file, switches);
  const std::string extension = lower_extension(file);
  if (extension == ".node" || extension == ".ele" || extension == ".msh") return load_tets(file);
  require_readable(file);  // a missing file or a folder is the better news
  throw Error(fmt::format("unknown mesh format '{}'", extension), file.string(),
              "use a surface (.ply .obj .stl .off) or tetrahedra (.node/.ele .msh)");
}

}  // namespace tetpbd
