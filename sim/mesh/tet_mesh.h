// Head of sim/mesh: surface and tetrahedral meshes in double precision (metres), from files, checked, filled
// by TetGen, kept in the cache, reported, written. Other rooms need this header alone. A new format is a
// reader in surface_files.cpp or tet_files.cpp; nothing here knows of solvers.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <glm/glm.hpp>
#include <string>
#include <vector>

#include "sim/error.h"

namespace tetpbd {

using Triangle = std::array<std::uint32_t, 3>;
using Tet = std::array<std::uint32_t, 4>;

/// Triangles counter-clockwise seen from outside.
struct SurfaceMesh {
  std::vector<glm::dvec3> positions;
  std::vector<Triangle> triangles;
};

/// Of bodies, solid or thin. Every tet has positive signed volume ((x1-x0)x(x2-x0)).(x3-x0)/6. `surface`
/// holds the faces that belong to one tet, outward (counter-clockwise from outside), indexing `positions`.
struct TetMesh {
  std::vector<glm::dvec3> positions;
  std::vector<Tet> tets;
  std::vector<Triangle> surface;
  bool one_piece = false;  ///< tets joined by faces: no hinges
  /// m, of a sheet, which has no tets: its triangles have mass, edges and hinges. Of a model's mesh the
  /// largest, 0 without sheets.
  double thickness = 0;
};

/// Largest coordinate of a mesh file: volumes (cubes of it) and their products stay far inside a double.
constexpr double largest_coordinate = 1e30;

/// PLY, OBJ, STL, OFF: polygons cut into triangles, vertices welded, those without a triangle dropped. Throws
/// Error for files that cannot be read or hold no triangle.
SurfaceMesh load_surface(const std::filesystem::path& file);

/// Merges vertices nearer than `tolerance` (metres) to one kept before them, drops triangles that collapse by
/// it, then vertices without one. Those not finite stay, for check_surface(). Indices must be in range.
void weld(SurfaceMesh& surface, double tolerance);
/// Drops positions that no element names; the others stay in their order. Indices must be in range.
template <std::size_t N>
void drop_unused_vertices(std::vector<glm::dvec3>& positions, std::vector<std::array<std::uint32_t, N>>& elements) {
  std::vector<std::uint32_t> number(positions.size(), 0);
  for (const auto& element : elements)
    for (const std::uint32_t v : element) number[v] = 1;
  std::uint32_t count = 0;
  for (std::size_t v = 0; v < positions.size(); ++v)
    if (number[v] == 1) {
      number[v] = count;
      positions[count++] = positions[v];
    }
  positions.resize(count);
  for (auto& element : elements)
    for (std::uint32_t& v : element) v = number[v];
}

/// What stands in the way of tetrahedralising; an empty `defect` means sound.
struct SurfaceCheck {
  int components = 0;
  int euler_characteristic = 0;
  double volume = 0;  ///< of all parts, m^3
  std::size_t flipped_triangles = 0;
  std::string defect;     ///< which defect; empty when there is none
  std::size_t count = 0;  ///< how many of it
  std::string place;      ///< the same in words, and where the first is
  std::string hint;       ///< what to do about it
  bool hopeless = false;  ///< no wrap mends it either (wrap.h)
};
/// Orients triangles consistently and outward where possible (that is no defect), and stops at the first
/// defect. Self-intersections are not looked for: TetGen finds them, and tetrahedralise() names them.
SurfaceCheck check_surface(SurfaceMesh& surface);
/// Mends what can be mended without a choice: vertices in one place merged, triangles without area and those
/// that others repeat dropped, then vertices without a triangle; turned outward where the rest is sound. Says
/// what it did; empty: nothing, and the surface is as it was.
std::string repair(SurfaceMesh& surface);

/// The surface encloses no solid that TetGen can fill; a wrap may (wrap.h).
struct NotSolid : Error {
  using Error::Error;
};

/// TetGen's switches without a leading '-' and with Q. Throws Error for those that need files, do something
/// else than fill a surface or do not exist, and when p is missing.
std::string checked_switches(const std::string& switches);
/// Runs the program tetgen with `switches` (for example "pYq1.85o/140") and a time limit in seconds. Results
/// are cached by content and switches in the user's cache folder. Throws Error, for a defect of `source`
/// NotSolid.
TetMesh tetrahedralise(const SurfaceMesh& surface, const std::string& switches, double time_limit = 600,
                       const std::string& source = "surface");

/// TetGen .node/.ele (either name given) or Gmsh .msh (ASCII 2.2 and 4.1).
TetMesh load_tets(const std::filesystem::path& file);
/// TetGen's pair, not yet finished.
TetMesh read_node_ele(const std::filesystem::path& file);
/// Any supported file: surfaces are checked and tetrahedralised with `switches`, tetrahedra are as they are.
TetMesh load_mesh(const std::filesystem::path& file, const std::string& switches);
bool is_surface_file(const std::filesystem::path& file);
/// Throws Error when write_mesh() does not know the extension.
void require_mesh_format(const std::filesystem::path& file);
/// By extension: .node/.ele or .msh (tetrahedra), .ply, .obj, .off or .stl (the boundary surface).
void write_mesh(const std::filesystem::path& file, const TetMesh& mesh);
void write_surface(const std::filesystem::path& file, const SurfaceMesh& surface);

/// Orients every tet, drops vertices without one, finds the boundary. Throws Error naming `source`.
void finish_tets(TetMesh& mesh, const std::string& source);
/// A block of cells nx * ny * nz, each cut into six tets (Kuhn), size in metres, centred on the origin.
TetMesh make_block(const glm::dvec3& size, const glm::ivec3& cells);
/// The same with rounded cross-sections along y, thinner by `taper` at the ends.
TetMesh make_spindle(const glm::dvec3& size, const glm::ivec3& cells, double taper);

/// A sheet of these triangles, which may be open, turned to agree with their neighbours where they can be; as
/// thick as a thousandth of its size. Throws Error naming `source`.
TetMesh sheet_of(SurfaceMesh surface, const std::string& source);
/// A flat one in the plane y = 0, size along x and z in metres, centred on the origin; the diagonals of its
/// cells alternate.
TetMesh make_sheet(const std::array<double, 2>& size, const std::array<int, 2>& cells);

double tet_volume(const TetMesh& mesh, const Tet& tet);
std::vector<double> tet_volumes(const TetMesh& mesh);
double mesh_volume(const TetMesh& mesh);  ///< m^3, sum of signed tet volumes
/// kg per vertex: a quarter of each adjacent tet's mass, of a sheet a third of each triangle's (density in
/// kg/m^3).
std::vector<double> lumped_masses(const TetMesh& mesh, double density);
/// Undirected edges of all tets and triangles, each once, sorted.
std::vector<std::array<std::uint32_t, 2>> tet_edges(const TetMesh& mesh);

struct Bounds {
  glm::dvec3 low{0}, high{0};
  glm::dvec3 centre() const { return (low + high) * 0.5; }
  double size() const { return glm::length(high - low); }  ///< length of the diagonal
};
/// Of the finite positions.
Bounds bounds(const std::vector<glm::dvec3>& positions);
/// "(x, y, z)", for errors.
std::string point_text(const glm::dvec3& p);

/// What `tetpbd mesh` prints and stats.json quotes.
struct MeshReport {
  std::size_t vertices, surface_vertices, surface_triangles, edges, bends, tets, faces;
  int euler_characteristic;  ///< V - E + F - T
  int genus;                 ///< of the tets' boundary, summed over its components
  int components;            ///< of tetrahedra and sheets (by shared vertices)
  double volume, smallest_tet_volume, mean_tet_volume;
  double min_dihedral_deg, max_dihedral_deg, mean_min_dihedral_deg;
  std::size_t slivers;  ///< tets with a dihedral angle under 5 or over 175 degrees
  std::size_t inverted;
};
MeshReport report(const TetMesh& mesh);

}  // namespace tetpbd
