#include "sim/reference/smoothed.h"

#include <algorithm>
#include <cmath>

#include "sim/parallel.h"

namespace tetpbd {

std::vector<Average> find_averages(const Averages& averages, const Points& positions) {
  std::vector<Average> at(averages.vertices.size());
  parallel_for(at.size(), 512, [&](std::size_t v) { at[v] = average_at(averages, v, positions); });
  return at;
}

double average_energy(const Averages::Vertex& vertex, const Average& at) {
  const double I = Formulas<double>{}.squares(at.F), beyond = at.J - vertex.alpha;
  const double shear = (I - 3) / 2 - 0.75 * (glm::determinant(at.F) - 1) - 0.5 * std::log((I + 1) / 4);
  return vertex.volume * (vertex.shear * shear + vertex.bulk / 2 * beyond * beyond);
}

Points average_forces(const Averages& averages, const std::vector<Average>& at) {
  Formulas<double> formulas;
  std::vector<glm::dmat3> stress(at.size());
  parallel_for(at.size(), 1024,
               [&](std::size_t v) { stress[v] = averages.vertices[v].shear * formulas.shear_stress(at[v].F); });
  Points forces(at.size(), glm::dvec3(0));
  parallel_for(at.size(), 512, [&](std::size_t v) {
    for (std::uint32_t k = averages.first_neighbour[v]; k < averages.first_neighbour[v + 1]; ++k) {
      const Averages::Neighbour& n = averages.neighbours[k];
      forces[v] += stress[v] * n.own - stress[n.vertex] * n.other;
    }
  });
  return forces;
}

glm::dmat3 AverageHessian::block(std::size_t i, std::size_t j) const {
  Formulas<double> formulas;
  glm::dmat3 result;
  for (int axis = 0; axis < 3; ++axis) {
    glm::dvec3 unit(0);
    unit[axis] = 1;
    const glm::dmat3 stress = shear * formulas.shear_change(F, glm::outerProduct(unit, gradients[j]), held);
    result[axis] = stress * gradients[i] + bulk * slopes[j][axis] * slopes[i];
  }
  return result;
}

AverageHessian average_hessian(const Averages& averages, std::size_t v, const Points& positions, bool positive) {
  const Averages::Vertex& vertex = averages.vertices[v];
  AverageHessian h{{std::uint32_t(v)}, {glm::dvec3(0)}, {}, average_at(averages, v, positions).F, 0, 0, -0.75};
  if (!(vertex.volume > 0)) return h;
  h.shear = vertex.shear / vertex.volume, h.bulk = vertex.bulk / vertex.volume;
  if (positive) h.held = Formulas<double>{}.shear_hold(h.F);
  for (std::uint32_t k = averages.first_neighbour[v]; k < averages.first_neighbour[v + 1]; ++k) {
    const Averages::Neighbour& n = averages.neighbours[k];
    h.ids.push_back(n.vertex), h.gradients.push_back(n.own), h.gradients[0] -= n.own;
  }
  h.slopes.assign(h.ids.size(), glm::dvec3(0));
  for (std::uint32_t k = averages.first_part[v]; k < averages.first_part[v + 1]; ++k) {
    const auto& [others, weight] = averages.parts[k];
    glm::dvec3 side[3];
    for (std::size_t j = 0; j < 3; ++j) side[j] = positions[others[j]] - positions[v];
    for (std::size_t j = 0; j < 3; ++j) {
      const glm::dvec3 slope = weight * glm::cross(side[(j + 1) % 3], side[(j + 2) % 3]);
      const auto found = std::ranges::lower_bound(h.ids.begin() + 1, h.ids.end(), others[j]);
      h.slopes[std::size_t(found - h.ids.begin())] += slope, h.slopes[0] -= slope;
    }
  }
  return h;
}

}  // namespace tetpbd
