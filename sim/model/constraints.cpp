#include "sim/model/constraints.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "sim/model/settings.h"
#include "sim/parallel.h"

namespace tetpbd {

namespace {

template <class Kind>
ConstraintList build_list(const TetMesh& mesh) {
  constexpr std::size_t arity = std::size_t(Kind::row.arity), values = std::size_t(Kind::row.values);
  const auto& all = Kind::vertices(mesh);
  ConstraintList list{Kind::row.arity, std::vector<std::uint32_t>(all.size() * arity),
                      std::vector<double>(all.size() * values)};
  parallel_for(all.size(), [&](std::size_t c) {
    std::copy_n(all[c].begin(), arity, list.vertices.begin() + std::ptrdiff_t(c * arity));
    // Positions are relative to the first vertex, as in the solvers, so that they find C = 0 at rest.
    std::array<glm::dvec3, arity> x;
    for (std::size_t j = 0; j < arity; ++j) x[j] = mesh.positions[all[c][j]] - mesh.positions[all[c][0]];
    const std::array<double, values> rest{Kind::rest(x.data())};
    std::ranges::copy(rest, list.rest.begin() + std::ptrdiff_t(c * values));
  });
  return list;
}

}  // namespace

std::vector<std::array<std::uint32_t, 4>> hinges(const TetMesh& mesh) {
  // Each directed edge of the surface is a side; two opposite sides make a hinge.
  struct Side {
    std::uint32_t low, high;
    bool forward;
    std::uint32_t wing;
    auto operator<=>(const Side&) const = default;
  };
  std::vector<Side> sides;
  sides.reserve(mesh.surface.size() * 3);
  for (const Triangle& t : mesh.surface)
    for (std::size_t c = 0; c < 3; ++c) {
      const std::uint32_t a = t[c], b = t[(c + 1) % 3];
      sides.push_back({std::min(a, b), std::max(a, b), a < b, t[(c + 2) % 3]});
    }
  std::ranges::sort(sides);
  std::vector<std::array<std::uint32_t, 4>> result;
  // A non-manifold edge of four sides, where two parts of a body touch along it, makes no hinge.
  for (std::size_t i = 0; i < sides.size();) {
    std::size_t end = i;
    while (end < sides.size() && sides[end].low == sides[i].low && sides[end].high == sides[i].high) ++end;
    // Wing 0 sees the edge x2 -> x3 run forwards, so a convex hinge has the same sign everywhere.
    if (end - i == 2 && sides[i].forward != sides[i + 1].forward)
      result.push_back({sides[i + 1].wing, sides[i].wing, sides[i].low, sides[i].high});
    i = end;
  }
  return result;
}

std::array<double, 8> NeoHookean::rest(glm::dvec3* x) {
  const glm::dmat3 sides(x[1] - x[0], x[2] - x[0], x[3] - x[0]);
  const glm::dmat3 m = glm::inverse(glm::transpose(sides) * sides);
  return {m[0][0], m[1][0], m[2][0], m[1][1], m[2][1], m[2][2], 1 / glm::determinant(sides), 1};
}

std::array<double, 4> Isobend::rest(glm::dvec3* x) {
  return std::to_array(Formulas<double>{}.isobend_rest(x, any_ids).values);
}

std::size_t ConstraintSystem::count() const {
  std::size_t sum = 0;
  for (const ConstraintList& list : lists) sum += list.count();
  return sum;
}

ConstraintSystem build_constraints(const TetMesh& mesh, const std::string& names) {
  ConstraintSystem system;
  system.at_vertex.assign(mesh.positions.size(), 0);
  const auto wanted = split(names, ',');
  for_each_kind([&]<class Kind>(Kind, int) {
    const bool is_wanted = std::ranges::find(wanted, Kind::row.name) != wanted.end();
    ConstraintList list = is_wanted ? build_list<Kind>(mesh) : ConstraintList{Kind::row.arity, {}, {}};
    for (std::uint32_t v : list.vertices) ++system.at_vertex[v];
    system.present.push_back(list.count() > 0);
    system.lists.push_back(std::move(list));
  });
  return system;
}

}  // namespace tetpbd
