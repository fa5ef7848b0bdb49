#include <fmt/format.h>

#include <algorithm>
#include <iterator>

#include "sim/error.h"
#include "sim/files.h"
#include "sim/mesh/msh_file.h"
#include "sim/mesh/tet_mesh.h"
#include "sim/mesh/text_file.h"

namespace tetpbd {
namespace {

SurfaceMesh boundary_surface(const TetMesh& mesh) {
  constexpr std::uint32_t none = ~0u;
  SurfaceMesh surface{{}, mesh.surface};
  std::vector<std::uint32_t> renumbered(mesh.positions.size(), none);
  for (const Triangle& t : mesh.surface)
    for (const std::uint32_t v : t) renumbered[v] = 0;
  for (std::size_t v = 0; v < renumbered.size(); ++v)
    if (renumbered[v] != none) {
      renumbered[v] = static_cast<std::uint32_t>(surface.positions.size());
      surface.positions.push_back(mesh.positions[v]);
    }
  for (Triangle& t : surface.triangles)
    for (std::uint32_t& v : t) v = renumbered[v];
  return surface;
}

template <class T>
void put(std::string& bytes, T value) {  // little-endian, as every machine this runs on
  bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

void put_point(std::string& bytes, const glm::dvec3& p) {
  for (int axis = 0; axis < 3; ++axis) put(bytes, static_cast<float>(p[axis]));
}

std::string ply_bytes(const SurfaceMesh& s) {
  std::string bytes = fmt::format(
      "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty "
      "float z\n"
      "element face {}\nproperty list uchar int vertex_indices\nend_header\n",
      s.positions.size(), s.triangles.size());
  for (const glm::dvec3& p : s.positions) put_point(bytes, p);
  for (const Triangle& t : s.triangles) {
    put(bytes, std::uint8_t{3});
    for (const std::uint32_t v : t) put(bytes, v);
  }
  return bytes;
}

std::string stl_bytes(const SurfaceMesh& s) {
  std::string bytes = "tetpbd boundary surface";
  bytes.resize(80, '\0');
  put(bytes, static_cast<std::uint32_t>(s.triangles.size()));
  for (const Triangle& t : s.triangles) {
    const glm::dvec3 normal =
        glm::cross(s.positions[t[1]] - s.positions[t[0]], s.positions[t[2]] - s.positions[t[0]]);
    const double length = glm::length(normal);
    put_point(bytes, length > 0 ? normal / length : glm::dvec3(0));
    for (const std::uint32_t v : t) put_point(bytes, s.positions[v]);
    put(bytes, std::uint16_t{0});
  }
  return bytes;
}

std::string obj_text(const SurfaceMesh& s) {
  fmt::memory_buffer text;
  const auto out = std::back_inserter(text);
  for (const glm::dvec3& p : s.positions) fmt::format_to(out, "v {} {} {}\n", p.x, p.y, p.z);
  for (const Triangle& t : s.triangles) fmt::format_to(out, "f {} {} {}\n", t[0] + 1, t[1] + 1, t[2] + 1);
  return fmt::to_string(text);
}

std::string off_text(const SurfaceMesh& s) {
  fmt::memory_buffer text;
  const auto out = std::back_inserter(text);
  fmt::format_to(out, "OFF\n{} {} 0\n", s.positions.size(), s.triangles.size());
  for (const glm::dvec3& p : s.positions) fmt::format_to(out, "{} {} {}\n", p.x, p.y, p.z);
  for (const Triangle& t : s.triangles) fmt::format_to(out, "3 {} {} {}\n", t[0], t[1], t[2]);
  return fmt::to_string(text);
}

std::string node_text(const TetMesh& mesh) {
  fmt::memory_buffer text;
  const auto out = std::back_inserter(text);
  fmt::format_to(out, "{} 3 0 0\n", mesh.positions.size());
  for (std::size_t v = 0; v < mesh.positions.size(); ++v)
    fmt::format_to(out, "{} {} {} {}\n", v, mesh.positions[v].x, mesh.positions[v].y, mesh.positions[v].z);
  return fmt::to_string(text);
}

std::string ele_text(const TetMesh& mesh) {
  fmt::memory_buffer text;
  const auto out = std::back_inserter(text);
  fmt::format_to(out, "{} 4 0\n", mesh.tets.size());
  for (std::size_t i = 0; i < mesh.tets.size(); ++i) {
    const Tet& t = mesh.tets[i];
    fmt::format_to(out, "{} {} {} {} {}\n", i, t[0], t[1], t[2], t[3]);
  }
  return fmt::to_string(text);
}

}  // namespace

void require_mesh_format(const std::filesystem::path& file) {
  const std::string extension = lower_extension(file);
  if (!is_surface_file(file) && extension != ".node" && extension != ".ele" && extension != ".msh")
    throw Error(fmt::format("unknown mesh format '{}'", extension), file.string(),
                "use .node, .ele or .msh for tetrahedra, .ply, .obj, .off or .stl for the boundary surface");
}

void write_mesh(const std::filesystem::path& file, const TetMesh& mesh) {
  require_mesh_format(file);
  const std::string extension = lower_extension(file);
  if (extension == ".node" || extension == ".ele") {
    std::filesystem::path node = file, ele = file;
    node.replace_extension(".node");
    ele.replace_extension(".ele");
    write_whole({{node, node_text(mesh)}, {ele, ele_text(mesh)}});
  } else if (extension == ".msh") {
    write_whole(file, msh_text(mesh));
  } else if (extension == ".ply") {
    write_whole(file, ply_bytes(boundary_surface(mesh)));
  } else if (extension == ".stl") {
    write_whole(file, stl_bytes(boundary_surface(mesh)));
  } else if (extension == ".obj") {
    write_whole(file, obj_text(boundary_surface(mesh)));
  } else {
    write_whole(file, off_text(boundary_surface(mesh)));
  }
}

}  // namespace tetpbd
