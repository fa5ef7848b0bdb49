// Surface and tetrahedral meshes in double precision (metres): read from files, checked, tetrahedralized by TetGen,
// cached, reported, written. A new format is a reader in surface_files.cpp, tet_files.cpp or vtk_files.cpp. Nothing
// here knows of solvers.
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

/// The faces of a tet of positive volume, opposite to its corners 0 to 3, counter-clockwise seen from outside.
constexpr std::array<Triangle, 4> tet_faces{{{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}}};
/// 1/m, by corner: how the corner's barycentric coordinate changes with the place in a tet of these corners.
std::array<glm::dvec3, 4> barycentric_gradients(const std::array<glm::dvec3, 4>& corners);

inline bool names_vertex_twice(const Triangle& t) { return t[0] == t[1] || t[1] == t[2] || t[2] == t[0]; }

/// Triangles are counter-clockwise seen from outside.
struct SurfaceMesh {
  std::vector<glm::dvec3> positions;
  std::vector<Triangle> triangles;
};

/// Bodies, solid or thin. Every tet has positive signed volume ((x1-x0)x(x2-x0)).(x3-x0)/6. `surface` has the faces
/// that belong to one tet, counter-clockwise seen from outside.
struct TetMesh {
  std::vector<glm::dvec3> positions;
  std::vector<Tet> tets;
  std::vector<Triangle> surface;
  bool one_piece = false;  ///< all tets are joined by faces, not only by vertices or edges
  /// m, of a sheet, which has no tets, only triangles; for all bodies of a model the largest, 0 without sheets.
  double thickness = 0;
  /// By tet, the share of its volume that the body fills, which its mass and stiffness are of; empty: all of it.
  std::vector<float> fill{};
  /// By tet, the number of its part in its file (Gmsh's physical group, TetGen's attribute); empty: none has one.
  std::vector<std::int32_t> tags{};
  std::size_t other_cells = 0;  ///< solid cells of its file that are no tets, and so were left out
};

/// Largest coordinate of a mesh file, so that volumes (its cube) and their products stay far inside a double's range.
constexpr double largest_coordinate = 1e30;

/// PLY, OBJ, STL, OFF: polygons are cut into triangles, vertices welded, and those without a triangle dropped. Throws
/// Error for files that cannot be read or, unless they may be, are without a triangle.
SurfaceMesh load_surface(const std::filesystem::path& file, bool may_be_empty = false);

/// load_surface() without welding and dropping, for repair(), which says what it does.
SurfaceMesh load_as_is(const std::filesystem::path& file);

/// Merges vertices that are no further than `tolerance` (metres) from an earlier one that stays, drops triangles that
/// collapse, then vertices without a triangle. Positions that are not finite stay for check_surface(). Indices must be
/// in range.
void weld(SurfaceMesh& surface, double tolerance);
/// Drops vertices that no element names; the others stay in their order. Indices must be in range.
template <class Vertex, std::size_t N>
void drop_unused_vertices(std::vector<Vertex>& vertices, std::vector<std::array<std::uint32_t, N>>& elements) {
  std::vector<std::uint32_t> number(vertices.size(), 0);
  for (const auto& element : elements)
    for (const std::uint32_t v : element) number[v] = 1;
  std::uint32_t count = 0;
  for (std::size_t v = 0; v < vertices.size(); ++v)
    if (number[v] == 1) {
      number[v] = count;
      vertices[count++] = vertices[v];
    }
  vertices.resize(count);
  for (auto& element : elements)
    for (std::uint32_t& v : element) v = number[v];
}

/// What keeps a surface from being tetrahedralized; an empty `defect` means nothing.
struct SurfaceCheck {
  int components = 0;
  int euler_characteristic = 0;
  double volume = 0;                 ///< m^3, of all parts, without cavities
  std::vector<glm::dvec3> cavities;  ///< a point in each
  std::size_t flipped_triangles = 0;
  std::string defect;     ///< the first defect found
  std::size_t count = 0;  ///< how often it occurs
  std::string place;      ///< the same in words, and where it occurs first
  std::string hint;       ///< what to do about it
  bool hopeless = false;  ///< a lattice does not fill it either (lattice.h)
};
/// Orients triangles consistently and away from what is solid where possible, which is no defect, and stops at the
/// first defect. A closed part in another bounds a cavity of it, and one in a cavity is solid again. Self-intersections
/// are left to TetGen; tetrahedralise() reports them.
SurfaceCheck check_surface(SurfaceMesh& surface);
/// Only the checks of indices and positions, where a defect is hopeless.
SurfaceCheck check_values(const SurfaceMesh& surface);
struct Outward {
  SurfaceMesh surface;                   ///< repaired, its triangles turned
  std::vector<std::uint32_t> patches{};  ///< of each triangle, its part of the surface
  int cavities = 0;
  bool closed = true;  ///< each of its parts
  double volume = 0;   ///< m^3, of all parts, without cavities; of a closed surface it is exact
};
/// Orients what may have any defect but hopeless ones: parts that are open by the side on which they are hollow.
Outward turn_outward(const SurfaceMesh& surface);
/// Repairs what needs no choice: merges vertices in one place, drops triangles without area or repeated and vertices
/// without a triangle, and turns triangles outward where the rest is sound. Says what it did; empty: nothing, and the
/// surface is as it was.
std::string repair(SurfaceMesh& surface);

/// TetGen cannot fill the surface; a lattice may (fill.h).
struct NotSolid : Error {
  using Error::Error;
};

/// TetGen's switches without a leading '-' and with Q. Throws Error for those that need files, do something else than
/// fill a surface or do not exist, and where p is missing.
std::string checked_switches(const std::string& switches);
/// Runs the program tetgen with `switches` (for example "pYq1.85o/140") and a time limit in seconds. Results are cached
/// by content and switches. Throws Error, or NotSolid for a defect of `source`.
TetMesh tetrahedralise(const SurfaceMesh& surface, const std::string& switches, double time_limit = 600,
                       const std::string& source = "surface");

/// What load_mesh() reads, for help and errors.
inline constexpr const char* mesh_formats =
    ".ply .obj .stl .off (surfaces), .node with .ele, .msh .vtk .vtu .mesh (tetrahedra)";
/// TetGen .node/.ele (either name given), Gmsh .msh (2.2 and 4.1), VTK .vtk and .vtu, Medit .mesh. Throws Error, also
/// where all solid cells are hexahedra, prisms and the like.
TetMesh load_tets(const std::filesystem::path& file);
/// TetGen's two files, without finish_tets().
TetMesh read_node_ele(const std::filesystem::path& file);
/// VTK's unstructured grids, likewise.
TetMesh read_vtk(const std::filesystem::path& file);
TetMesh read_vtu(const std::filesystem::path& file);
/// Any supported file: surfaces are checked and tetrahedralized with `switches`, tetrahedra stay as they are.
TetMesh load_mesh(const std::filesystem::path& file, const std::string& switches);
bool is_surface_file(const std::filesystem::path& file);
/// Throws Error when write_mesh() does not know the extension.
void require_mesh_format(const std::filesystem::path& file);
/// By extension: .node/.ele or .msh (tetrahedra), .ply, .obj, .off or .stl (the boundary surface).
void write_mesh(const std::filesystem::path& file, const TetMesh& mesh);
void write_surface(const std::filesystem::path& file, const SurfaceMesh& surface);

/// Orients every tet, drops vertices without one, finds the boundary. Throws Error naming `source`.
void finish_tets(TetMesh& mesh, const std::string& source);
/// A block of nx * ny * nz cells, each cut into six tets (Kuhn); size in metres, centred on the origin. Diagonals of
/// all cells point the same way, so that a load along an axis makes the block lean by its mesh alone; mirrored, every
/// second cell along each axis is the mirror image of the one before, and only the last of an odd count still leans.
TetMesh make_block(const glm::dvec3& size, const glm::ivec3& cells, bool mirrored = false);
/// The same with rounded cross-sections along y, thinner by `taper` at the ends.
TetMesh make_spindle(const glm::dvec3& size, const glm::ivec3& cells, double taper, bool mirrored = false);

/// A sheet of these triangles, which may be open and are turned to agree with their neighbours where possible; its
/// thickness is a thousandth of its size. Throws Error naming `source`.
TetMesh sheet_of(SurfaceMesh surface, const std::string& source);
/// A flat sheet in the plane y = 0, size along x and z in metres, centred on the origin. The diagonals of its cells
/// alternate.
TetMesh make_sheet(const std::array<double, 2>& size, const std::array<int, 2>& cells);

double tet_volume(const TetMesh& mesh, const Tet& tet);
double least_altitude(const TetMesh& mesh, const Tet& tet);  ///< m, from a corner to the face opposite to it
inline double fill_of(const TetMesh& mesh, std::size_t tet) { return mesh.fill.empty() ? 1.0 : double(mesh.fill[tet]); }
std::vector<double> tet_volumes(const TetMesh& mesh);
double mesh_volume(const TetMesh& mesh);    ///< m^3, sum of signed tet volumes
double filled_volume(const TetMesh& mesh);  ///< m^3, of which the body fills its tets
/// kg for each vertex: a quarter of each adjacent tet's mass, in a sheet a third of each triangle's; density in kg/m^3.
std::vector<double> lumped_masses(const TetMesh& mesh, double density);
/// Undirected edges of all tets and triangles, each once, sorted.
std::vector<std::array<std::uint32_t, 2>> tet_edges(const TetMesh& mesh);

struct Bounds {
  glm::dvec3 low{0}, high{0};
  glm::dvec3 centre() const { return (low + high) * 0.5; }
  double size() const { return glm::length(high - low); }  ///< length of the diagonal
};
/// The bounding box of the finite positions.
Bounds bounds(const std::vector<glm::dvec3>& positions);
/// "(x, y, z)", for errors.
std::string point_text(const glm::dvec3& p);

/// The tet that limits the steps of solvers with forces.
struct FlattestTet {
  std::size_t tet = 0;
  double altitude = 0;  ///< m, its least
  double quality = 0;   ///< that over the mean length of edges: where all tets are regular 0.82, of a flat one 0
};
FlattestTet flattest_tet(const TetMesh& mesh);
double mean_edge(const TetMesh& mesh);  ///< m, of the edges of each tet
/// What `tetpbd mesh` prints and stats.json quotes.
struct MeshReport {
  std::size_t vertices, surface_vertices, surface_triangles, edges, bends, tets, faces;
  int euler_characteristic;  ///< V - E + F - T
  int genus;                 ///< of the tets' boundary, summed over its components
  int components;            ///< of tetrahedra and sheets (by shared vertices)
  double filled;             ///< m^3, of which the body is
  double volume, smallest_tet_volume, mean_tet_volume;
  double min_dihedral_deg, max_dihedral_deg, mean_min_dihedral_deg;
  double worst_altitude;  ///< m, the least of a tet's corner over the opposite face
  std::size_t worst_tet;  ///< which has it
  int cavities;           ///< of all bodies
  std::size_t slivers;    ///< tets with a dihedral angle under 5 or over 175 degrees
  std::size_t inverted;
  glm::dvec3 size;  ///< m, of the bounding box
};
MeshReport report(const TetMesh& mesh);

}  // namespace tetpbd
