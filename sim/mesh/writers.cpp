// Writes text with all digits, and STL in binary with floats.
#include <fmt/format.h>

#include <iterator>

#include "sim/error.h"
#include "sim/files.h"
#include "sim/mesh/tet_mesh.h"
#include "sim/mesh/text_file.h"

namespace tetpbd {
namespace {

namespace fs = std::filesystem;

std::string stl_bytes(const SurfaceMesh& s) {
  std::string bytes = "tetpbd boundary surface";
  bytes.resize(80, '\0');
  const auto put = [&bytes](const auto& value) {  // little-endian, as are all supported machines
    bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
  };
  put(std::uint32_t(s.triangles.size()));
  for (const Triangle& t : s.triangles) {
    const glm::dvec3 &a = s.positions[t[0]], &b = s.positions[t[1]], &c = s.positions[t[2]];
    for (const glm::dvec3& p : {glm::normalize(glm::cross(b - a, c - a)), a, b, c}) put(glm::vec3(p));
    put(std::uint16_t{0});
  }
  return bytes;
}

}  // namespace

void write_surface(const fs::path& file, const SurfaceMesh& surface) {
  const std::string extension = lower_extension(file);
  if (extension == ".stl") return write_file(file, stl_bytes(surface));
  const bool obj = extension == ".obj";
  const std::size_t vertices = surface.positions.size(), triangles = surface.triangles.size();
  std::string text;
  if (extension == ".off") text = fmt::format("OFF\n{} {} 0\n", vertices, triangles);
  if (extension == ".ply")
    text = fmt::format(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\n"
        "element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        vertices, triangles);
  const auto out = std::back_inserter(text);
  for (const glm::dvec3& p : surface.positions) fmt::format_to(out, "{}{} {} {}\n", obj ? "v " : "", p.x, p.y, p.z);
  for (const Triangle& t : surface.triangles)
    fmt::format_to(out, "{} {} {} {}\n", obj ? "f" : "3", t[0] + obj, t[1] + obj, t[2] + obj);
  write_file(file, text);
}

void write_mesh(const fs::path& file, const TetMesh& mesh) {
  require_mesh_format(file);
  if (is_surface_file(file)) {
    SurfaceMesh surface{mesh.positions, mesh.surface};
    drop_unused_vertices(surface.positions, surface.triangles);
    return write_surface(file, surface);
  }
  // .msh counts from 1; its elements have two tags, physical and elementary entity, as Gmsh requires.
  const bool msh = lower_extension(file) == ".msh";
  std::string nodes, tets;
  std::size_t node = msh, tet = msh;
  for (const glm::dvec3& p : mesh.positions)
    fmt::format_to(std::back_inserter(nodes), "{} {} {} {}\n", node++, p.x, p.y, p.z);
  for (const Tet& t : mesh.tets)
    fmt::format_to(std::back_inserter(tets), "{}{} {} {} {} {}\n", tet++, msh ? " 4 2 1 1" : "", t[0] + msh, t[1] + msh,
                   t[2] + msh, t[3] + msh);
  if (msh)
    return write_file(file, fmt::format("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{}\n{}$EndNodes\n"
                                        "$Elements\n{}\n{}$EndElements\n",
                                        mesh.positions.size(), nodes, mesh.tets.size(), tets));
  write_file(fs::path(file).replace_extension(".ele"), fmt::format("{} 4 0\n{}", mesh.tets.size(), tets));
  write_file(fs::path(file).replace_extension(".node"), fmt::format("{} 3 0 0\n{}", mesh.positions.size(), nodes));
}

}  // namespace tetpbd
