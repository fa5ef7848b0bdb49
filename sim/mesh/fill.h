// Bodies of surfaces: by TetGen, which keeps the surface's triangles, or by a fitted lattice, which any surface takes.
#pragma once

#include <string>

#include "sim/mesh/carry.h"
#include "sim/mesh/lattice.h"
#include "sim/mesh/tet_mesh.h"

namespace tetpbd {

struct FillOptions {
  std::string by{};                       ///< "tetgen", "lattice", or empty: what suits the surface
  std::string switches = "pYq1.85o/140";  ///< of TetGen
  LatticeSize size{};
  bool sized = false;   ///< somebody asks for `size`, which the lattice alone can meet
  glm::dvec3 scale{1};  ///< of the surface before a lattice fills it, whose cells are regular then
};
struct Filled {
  TetMesh mesh{};
  CarriedSurface carried{};  ///< the given surface, where a lattice was filled; else empty
  glm::dvec3 scale{1};       ///< by which the mesh is larger than the surface
  int cavities = 0;
  std::string note{};  ///< what was done, and why; empty where TetGen filled the surface without being asked
};
/// What TetGen refuses, and what it fills with tets so flat that no solver takes long steps, is filled with a lattice,
/// unless the options name one of the two, or switches. Results are cached. Throws Error.
Filled fill(const SurfaceMesh& surface, const FillOptions& options, const std::string& source);

}  // namespace tetpbd
