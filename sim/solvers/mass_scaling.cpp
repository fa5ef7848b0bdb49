#include "sim/solvers/mass_scaling.h"

#include <algorithm>
#include <cmath>

#include "sim/reference/leapfrog.h"

namespace tetpbd {

namespace {

// N/m by vertex: the trace of its block of the stiffness matrix at rest.
std::vector<double> stiffness_at_rest(const ReferenceInput& input) {
  std::vector<double> stiffness(input.model.masses.size(), 0);
  const auto& rest = input.model.rest.positions;
  // Each average resists through all vertices around it; shear counts as by C[0] of a tet at rest.
  const Averages& averages = input.system.averages;
  constexpr double by_shear = 9 / (16 * (3 - 1.3862943611198906));
  const auto resistance = [&](std::size_t v, const glm::dvec3& gradient) {
    const Averages::Vertex& at = averages.vertices[v];
    return (by_shear * at.shear + at.bulk) * glm::dot(gradient, gradient) / at.volume;
  };
  for (std::size_t v = 0; v < averages.vertices.size(); ++v) {
    glm::dvec3 own(0);
    for (std::uint32_t k = averages.first_neighbour[v]; k < averages.first_neighbour[v + 1]; ++k) {
      const Averages::Neighbour& n = averages.neighbours[k];
      own -= n.own, stiffness[v] += resistance(n.vertex, n.other);
    }
    if (averages.vertices[v].volume > 0) stiffness[v] += resistance(v, own);
  }
  for_each_elastic(input.system, input.settings.compliance, [&](auto kind, const ConstraintList& list, auto&& alpha) {
    constexpr std::size_t arity = std::size_t(decltype(kind)::row.arity);
    for (std::size_t c = 0; c < list.count(); ++c) {
      const auto vertices = list.ends(c);
      std::array<glm::dvec3, arity> x;
      for (std::size_t j = 0; j < arity; ++j) x[j] = rest[vertices[j]] - rest[vertices[0]];
      const auto value = unclamped<decltype(kind)>(x, &list.rest[c * std::size_t(kind.row.values)]);
      for (int k = 0; k < kind.row.components - int(kind.row.averaged); ++k)
        for (std::size_t j = 0; j < arity; ++j) {
          const glm::dvec3 gradient = component(value, k).second[j];
          stiffness[vertices[j]] += glm::dot(gradient, gradient) / alpha(c)[k];
        }
    }
  });
  return stiffness;
}

// The least stiffness over mass, 1/s^2, to which a body's vertices can be brought by at most `share` of its mass, and
// at a tenth of its vertices: what is as stiff as most of the body is not to be made heavier.
double least_ratio(const Body& body, const std::vector<double>& masses, const std::vector<double>& stiffness,
                   double share) {
  double mass = 0;
  std::vector<double> ratios;
  for (std::size_t v = body.first_vertex; v < body.first_vertex + body.vertices; ++v) {
    mass += masses[v];
    ratios.push_back(stiffness[v] / masses[v]);
  }
  std::ranges::sort(ratios);
  double low = ratios[ratios.size() - 1 - ratios.size() / 10], high = ratios.back();
  const auto is_too_heavy = [&](double ratio) {
    double added = 0;
    for (std::size_t v = body.first_vertex; v < body.first_vertex + body.vertices; ++v)
      added += std::max(0.0, stiffness[v] / ratio - masses[v]);
    return added > share * mass;
  };
  if (!is_too_heavy(low)) return low;
  for (int turn = 0; turn < 60; ++turn) {
    const double middle = std::sqrt(low * high);
    (is_too_heavy(middle) ? low : high) = middle;
  }
  return high;
}

}  // namespace

ScaledMasses scale_masses(const ReferenceInput& input, int iterations) {
  const Model& model = input.model;
  const auto longest = [&](const std::vector<double>& inverse_masses) {
    return stable_step({model, input.system, input.settings, inverse_masses}, input.settings.compliance,
                       model.rest.positions, iterations);
  };
  ScaledMasses result;
  result.masses = model.masses, result.longest_step = longest(input.inverse_masses);
  if (input.settings.mass_scaling == 0) return result;
  std::vector<double> stiffness = stiffness_at_rest(input), inverse_masses = input.inverse_masses;
  for (std::size_t v = 0; v < stiffness.size(); ++v)
    if (inverse_masses[v] == 0) stiffness[v] = 0;
  double ratio = 0;
  for (const Body& body : model.bodies)
    ratio = std::max(ratio, least_ratio(body, model.masses, stiffness, input.settings.mass_scaling));
  ScaledMasses heavier = result;
  for (std::size_t v = 0; v < stiffness.size(); ++v) {
    if (!(stiffness[v] > ratio * model.masses[v])) continue;
    heavier.masses[v] = stiffness[v] / ratio;
    heavier.added += heavier.masses[v] - model.masses[v];
    ++heavier.vertices;
    inverse_masses[v] = 1 / heavier.masses[v];
  }
  heavier.longest_step = longest(inverse_masses);
  heavier.gain = heavier.longest_step / result.longest_step;
  return heavier.gain >= 1.2 ? heavier : result;
}

}  // namespace tetpbd
