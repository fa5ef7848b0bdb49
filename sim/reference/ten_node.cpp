#include "sim/reference/ten_node.h"

#include <algorithm>
#include <cmath>

namespace tetpbd {
namespace {

constexpr std::array<std::array<std::size_t, 2>, 6> edges{{{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}}};
// Node of the middle between two corners; a corner itself where they are one.
constexpr std::size_t node[4][4] = {{0, 4, 5, 6}, {4, 1, 7, 8}, {5, 7, 2, 9}, {6, 8, 9, 3}};

// Nodes of the eight tets: those at the corners, then those around the diagonal from edge 01 to edge 23.
constexpr std::array<std::array<std::size_t, 4>, 8> eighths{
    {{0, 4, 5, 6}, {4, 1, 7, 8}, {5, 7, 2, 9}, {6, 8, 9, 3}, {4, 9, 5, 7}, {4, 9, 7, 8}, {4, 9, 8, 6}, {4, 9, 6, 5}}};

void halve_body(const Model& model, const Body& body, Halved& result) {
  const auto first = std::uint32_t(body.first_vertex);
  const TetMesh coarse = body_mesh(model, body);
  const auto sides = tet_edges(coarse);
  const auto middle = [&](std::uint32_t a, std::uint32_t b) {
    const std::array<std::uint32_t, 2> side{std::min(a, b), std::max(a, b)};
    return std::uint32_t(body.vertices) + std::uint32_t(std::ranges::lower_bound(sides, side) - sides.begin());
  };
  // The values at the corners, then those halfway between.
  const auto with_middles = [&](const Points& all) {
    const auto begin = all.begin() + std::ptrdiff_t(first);
    Points values(begin, begin + std::ptrdiff_t(body.vertices));
    for (const auto& [a, b] : sides) values.push_back((values[a] + values[b]) * 0.5);
    return values;
  };
  TetMesh fine{with_middles(model.rest.positions), {}, {}};
  for (std::size_t t = 0; t < coarse.tets.size(); ++t) {
    const Tet& tet = coarse.tets[t];
    std::array<std::uint32_t, 10> nodes{tet[0], tet[1], tet[2], tet[3]};
    for (std::size_t e = 0; e < 6; ++e) nodes[4 + e] = middle(tet[edges[e][0]], tet[edges[e][1]]);
    for (const auto& eighth : eighths) {
      fine.tets.push_back({nodes[eighth[0]], nodes[eighth[1]], nodes[eighth[2]], nodes[eighth[3]]});
      if (!coarse.fill.empty()) fine.fill.push_back(coarse.fill[t]);
    }
  }
  finish_tets(fine, "the tets of body " + body.name + ", halved");
  const auto is_fixed = [&](std::uint32_t v) { return model.inverse_masses[first + v] == 0; };
  std::vector<std::uint32_t> fixed;
  for (std::uint32_t v = 0; v < body.vertices; ++v)
    if (is_fixed(v)) fixed.push_back(v);
  for (const auto& [a, b] : sides)
    if (is_fixed(a) && is_fixed(b)) fixed.push_back(middle(a, b));
  add_body(result.model, body.name, fine, body_mass(model, body) / filled_volume(fine), with_middles(model.positions),
           glm::dvec3(0), glm::dvec3(0), fixed);
  Body& added = result.model.bodies.back();
  std::ranges::copy(with_middles(model.velocities),
                    result.model.velocities.begin() + std::ptrdiff_t(added.first_vertex));
  for (std::uint32_t v : fixed) result.model.velocities[added.first_vertex + v] = glm::dvec3(0);
  for (std::uint32_t v = 0; v < body.vertices; ++v) result.corner.push_back(std::uint32_t(added.first_vertex) + v);
}

// Barycentric coordinates of the four points of integration, each a quarter of the volume.
constexpr double near = 0.58541019662496845446, away = 0.13819660112501051518;

// dx/dL of each barycentric coordinate L at point p. The deformation gradient is their sum, each times its gradient.
std::array<glm::dvec3, 4> tangents(const TenNodeTet& tet, const Points& x, std::size_t p) {
  std::array<glm::dvec3, 4> sums;
  for (std::size_t k = 0; k < 4; ++k) {
    sums[k] = (4 * (k == p ? near : away) - 1) * x[tet.nodes[k]];
    for (std::size_t j = 0; j < 4; ++j)
      if (j != k) sums[k] += 4 * (j == p ? near : away) * x[tet.nodes[node[k][j]]];
  }
  return sums;
}

glm::dmat3 deformation(const TenNodeTet& tet, const Points& x, std::size_t p) {
  glm::dmat3 F(0);
  const auto sums = tangents(tet, x, p);
  for (std::size_t k = 0; k < 4; ++k) F += glm::outerProduct(sums[k], tet.gradients[k]);
  return F;
}

}  // namespace

Halved halve_edges(const Model& model) {
  Halved result;
  for (const Body& body : model.bodies) halve_body(model, body, result);
  result.model.obstacles = model.obstacles;
  return result;
}

std::vector<TenNodeTet> ten_node_tets(const ConstraintList& halved, const Points& rest) {
  std::vector<TenNodeTet> result(halved.count() / 8);
  for (std::size_t t = 0; t < result.size(); ++t) {
    TenNodeTet& tet = result[t];
    for (std::size_t i = 0; i < 4; ++i)
      for (std::size_t j = 0; j < 4; ++j) tet.nodes[node[i][j]] = halved.ends(8 * t + i)[j];
    const auto& [a, b, c, d] = std::array{tet.nodes[0], tet.nodes[1], tet.nodes[2], tet.nodes[3]};
    tet.gradients = barycentric_gradients({rest[a], rest[b], rest[c], rest[d]});
    tet.mu = 8 / halved.compliance[16 * t], tet.lambda = 8 / halved.compliance[16 * t + 1];
    tet.alpha = halved.rest[64 * t + 7];
  }
  return result;
}

double energy(const TenNodeTet& tet, const Points& x) {
  double sum = 0;
  for (std::size_t p = 0; p < 4; ++p) {
    const glm::dmat3 F = deformation(tet, x, p);
    const double I = Formulas<double>{}.squares(F), beyond = glm::determinant(F) - tet.alpha;
    sum += tet.mu / 8 * (I - std::log(I + 1)) + tet.lambda / 8 * beyond * beyond;
  }
  return sum;
}

std::array<glm::dvec3, 10> forces(const TenNodeTet& tet, const Points& x) {
  std::array<glm::dvec3, 10> result{};
  for (std::size_t p = 0; p < 4; ++p) {
    const glm::dmat3 F = deformation(tet, x, p);
    Formulas<double> formulas;
    const glm::dmat3 cofactors = formulas.cofactors(F);
    const double beyond = glm::dot(F[0], cofactors[0]) - tet.alpha;
    const glm::dmat3 stress =
        tet.mu / 4 * (1 - 1 / (formulas.squares(F) + 1)) * F + tet.lambda / 4 * beyond * cofactors;
    for (std::size_t k = 0; k < 4; ++k) {
      const glm::dvec3 pull = stress * tet.gradients[k];
      result[k] -= (4 * (k == p ? near : away) - 1) * pull;
      for (std::size_t j = 0; j < 4; ++j)
        if (j != k) result[node[k][j]] -= 4 * (j == p ? near : away) * pull;
    }
  }
  return result;
}

}  // namespace tetpbd
