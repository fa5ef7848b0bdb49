// Bodies of surfaces and of files' tets: by TetGen, which keeps the surface's triangles, or by a fitted lattice, which
// any surface takes.
#pragma once

#include <functional>
#include <string>

#include "sim/mesh/carry.h"
#include "sim/mesh/lattice.h"
#include "sim/mesh/tet_mesh.h"

namespace tetpbd {

struct FillOptions {
  std::string by{};                       ///< "tetgen", "lattice", "file" (its tets), or empty: what suits it
  std::string switches = "pYq1.85o/140";  ///< of TetGen
  LatticeSize size{};
  bool sized = false;                      ///< somebody asks for `size`, which the lattice alone can meet
  glm::dvec3 scale{1};                     ///< of the surface before a lattice fills it, whose cells are regular then
  std::function<void(double)> progress{};  ///< told now and then which part of a lattice is done
};
struct Filled {
  TetMesh mesh{};
  CarriedSurface carried{};  ///< the given surface, where a lattice was filled; else empty
  glm::dvec3 scale{1};       ///< by which the mesh is larger than the surface
  int cavities = 0;
  Fit fit{};           ///< of a lattice; else without the thinnest part, which is that of the mesh's boundary
  std::string note{};  ///< what was done, and why; empty where TetGen filled the surface, or a file's tets stayed
};
/// What TetGen refuses, and what it fills with tets so flat that no solver takes long steps, is filled with a lattice,
/// unless the options name one of the two, or switches. Results are cached. Throws Error.
Filled fill(const SurfaceMesh& surface, const FillOptions& options, const std::string& source);
/// Likewise with a file's tets, whose boundary is filled anew if one of them is so flat, or the options say so.
Filled refill(TetMesh mesh, const FillOptions& options, const std::string& source);
/// Which tet is so flat, if one is: "tet 7 near (0, 1, 2) is as flat as 0.004 of an edge".
std::string too_flat(const TetMesh& mesh);

}  // namespace tetpbd
