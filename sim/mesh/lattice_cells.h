// The cells of a lattice that a body is in, and what of each belongs to which part of it (lattice.h).
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "sim/mesh/carry.h"
#include "sim/mesh/disjoint_sets.h"
#include "sim/mesh/solid.h"
#include "sim/mesh/tet_mesh.h"

namespace tetpbd {

/// A point in a cell that is inside the body, and the winding number there.
struct Site {
  glm::dvec3 at;
  double winding;
};
/// What of a cell belongs to one part of the body: parts that are nearer than a cell stay apart, each with tets of its
/// own in the same place.
struct Piece {
  std::uint32_t cell;
  bool whole;               ///< far from the surface
  bool shared;              ///< the cell has several pieces
  float fill;               ///< share of the cell
  std::vector<Site> sites;  ///< none: it is taken off
  std::array<glm::dvec3, 4> corners{};
};

/// Points of the lattice are origin + h / 2 (x, y, z) with all coordinates even or all odd.
struct LatticeGrid {
  double h;
  glm::dvec3 origin;
  glm::ivec3 size;
  glm::dvec3 place(const glm::ivec3& p) const { return origin + h / 2 * glm::dvec3(p); }
  std::uint64_t number(const glm::ivec3& p) const {
    return std::uint64_t(p.x) +
           std::uint64_t(size.x) * (std::uint64_t(p.y) + std::uint64_t(size.y) * std::uint64_t(p.z));
  }
  glm::dvec3 place(std::uint64_t number) const {
    const auto nx = std::uint64_t(size.x), ny = std::uint64_t(size.y);
    return place(glm::ivec3(int(number % nx), int(number / nx % ny), int(number / nx / ny)));
  }
};
/// Four points of the lattice by number: a tet of it.
using Cell = std::array<std::uint64_t, 4>;
/// Of each vertex, whether it is on the boundary.
std::vector<char> outer_vertices(const TetMesh& mesh);

/// In this order: find(), join(), keep_parts(), which makes the mesh; then, once it is fitted, fill(), peel() and
/// keep_parts() again as often as wanted. Tets of the mesh and pieces have the same numbers.
class LatticeCells {
 public:
  /// `box`: of the surface; h: m.
  LatticeCells(const Solid& inside, const Bounds& box, double h);
  /// Finds the pieces, and which corners they share. `watch` is told which part of them is found.
  void find(const std::function<void(double)>& watch);
  void join();
  /// Takes off tets that the body hardly fills, before keep_parts().
  void peel(TetMesh& mesh);
  /// Makes the mesh of the largest body that is near each patch of the surface. Returns how many bodies that are, and
  /// the share of the volume that is not in them.
  std::size_t keep_parts(const std::vector<std::uint32_t>& patches, TetMesh& mesh, double& left_out);
  /// Finds the shares anew where tets have moved.
  void fill(TetMesh& mesh) const;
  /// `boundary`: of the mesh.
  CarriedSurface carry_surface(const SurfaceMesh& given, const TetMesh& mesh, const Solid& boundary,
                               const std::string& source) const;
  const std::vector<Piece>& all() const { return pieces; }

 private:
  void number_tets(TetMesh& mesh);
  std::vector<Piece> split(const Cell& cell, std::uint32_t number) const;
  bool joined(const Piece& a, const Piece& b) const;
  std::array<glm::dvec3, 4> corners(const Cell& cell) const {
    return {grid.place(cell[0]), grid.place(cell[1]), grid.place(cell[2]), grid.place(cell[3])};
  }
  const Solid& solid;
  LatticeGrid grid;
  std::vector<glm::dvec4> weights;  ///< of samples in a cell
  std::vector<Cell> cells;
  std::vector<Piece> pieces;  ///< by cell
  DisjointSets nodes{0};      ///< of the pieces' corners, 4 to a piece
  DisjointSets bodies{0};     ///< of pieces that are joined by faces
};

}  // namespace tetpbd
