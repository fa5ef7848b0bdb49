// Ten-node tets in double, whose displacement is quadratic and whose sides are straight at rest (Zienkiewicz and Taylor
// 2000). Linear tets bend too stiffly; on the same mesh these are some ten times nearer to what the material does.
// They stand in the place of neo-Hookean tets in leapfrog.h, where the error of a mesh is asked for (total_error.h).
#pragma once

#include <array>
#include <vector>

#include "sim/model/constraints.h"
#include "sim/model/model.h"
#include "sim/reference/objective.h"

namespace tetpbd {

/// A model with a vertex in the middle of each edge. A tet becomes eight in a row, the first four at its corners.
struct Halved {
  Model model;
  std::vector<std::uint32_t> corner;  ///< by vertex of the model it was made of, its number here
};
/// Bodies keep their materials, friction and total mass, which is spread as their density has it. A middle is fixed
/// where both ends are.
Halved halve_edges(const Model& model);

struct TenNodeTet {
  std::array<std::uint32_t, 10> nodes;  ///< corners, then the middles of edges 01 02 03 12 13 23
  std::array<glm::dvec3, 4> gradients;  ///< 1/m, of the barycentric coordinates at rest
  double mu, lambda;                    ///< J, Smith's parameters times what is filled of the volume at rest
  double alpha;                         ///< the J at which the second term of the energy is least
};
/// Of the neo-Hookean tets of a halved model, which come in eights.
std::vector<TenNodeTet> ten_node_tets(const ConstraintList& halved, const Points& rest);
/// J, by four points of integration, which are exact for linear elasticity.
double energy(const TenNodeTet& tet, const Points& x);
/// -dE/dx of the ten nodes, N.
std::array<glm::dvec3, 10> forces(const TenNodeTet& tet, const Points& x);

}  // namespace tetpbd
