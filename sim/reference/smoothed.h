// The energy of smoothed tets (method.md, "Smoothed tets") in double: what the averages around each vertex store and
// how they pull. Tets have the rest of it as constraints of kind Smoothed, whose C[1] is by averages.
#pragma once

#include <algorithm>
#include <array>

#include "sim/reference/objective.h"

namespace tetpbd {

/// By vertex; empty where there are no averages.
std::vector<Average> find_averages(const Averages& averages, const Points& positions);
/// J, of a vertex.
double average_energy(const Averages::Vertex& vertex, const Average& at);
/// N, -dE/dx by the averages of F alone: pressure acts through C[1] of the tets. Empty where there are no averages.
Points average_forces(const Averages& averages, const std::vector<Average>& at);

/// J of tet c, whose corners are x, and by how much that is above what stands in its place (smoothed.glsl).
struct OwnVolume {
  double J, excess;
};
inline OwnVolume own_volume(std::array<glm::dvec3, 4>& x, const std::uint32_t* vertices, const ConstraintList& list,
                            std::size_t c, const std::vector<Average>& at) {
  double mean = 0;
  for (std::size_t j = 0; j < 4; ++j) mean += 0.25 * at[vertices[j]].J;
  Formulas<double> formulas;
  const double J = formulas.smoothed_jacobian(x.data(), &list.rest[8 * c]);
  return {J, J - formulas.smoothed_J(mean, J)};
}

/// Calls visit(number, vertex, average) for every vertex that has one.
template <class F>
void for_each_average(const Averages& averages, const Points& positions, F&& visit) {
  for (std::size_t v = 0; v < averages.vertices.size(); ++v)
    if (averages.vertices[v].volume > 0) visit(v, averages.vertices[v], average_at(averages, v, positions));
}

/// What the average of a vertex adds to the Hessian: blocks in J/m^2 between it, the first, and its neighbours.
struct AverageHessian {
  std::vector<std::uint32_t> ids;
  Points gradients, slopes;  ///< m^2: of V F and of V J
  glm::dmat3 F;
  double shear, bulk, held;  ///< Pa/m^3, Pa/m^3; shear_change()
  glm::dmat3 block(std::size_t i, std::size_t j) const;
};
/// Its stress is made positive if so asked. What curves J is not in it, but in the Hessian of the tets.
AverageHessian average_hessian(const Averages& averages, std::size_t vertex, const Points& positions, bool positive);

}  // namespace tetpbd
