// A body-centred cubic lattice of tets, fitted to a surface: it fills what TetGen refuses, and its tets are all of one
// size and well shaped, so that solvers take long steps (docs/method.md, "Lattices").
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "sim/mesh/carry.h"
#include "sim/mesh/tet_mesh.h"
#include "sim/mesh/thickness.h"

namespace tetpbd {

struct LatticeSize {
  double tets = 15000;  ///< about so many
  double spacing = 0;   ///< m, between neighbouring points of one kind; 0: as `tets` asks for
};
struct Lattice {
  TetMesh mesh;            ///< with the share of each tet that the body fills
  CarriedSurface carried;  ///< the given surface
  double spacing = 0;      ///< m
  int parts = 0, cavities = 0;
  Fit fit;           ///< of the surface, as it was given
  std::string note;  ///< what is thinner than a cell or was left out; empty: nothing
};
/// Fills what the surface encloses, however broken it is: open, in many parts, crossing itself. Throws Error where it
/// encloses nothing or memory does not suffice, and when interrupted. `progress`: told now and then which part is done.
Lattice fill_with_lattice(const SurfaceMesh& surface, const LatticeSize& size, const std::string& source,
                          const std::function<void(double)>& progress = {});

}  // namespace tetpbd
