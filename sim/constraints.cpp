#include "sim/constraints.h"

#include <algorithm>
#include <array>

#include "sim/parallel.h"
#include "sim/settings.h"

namespace tetpbd {

namespace {

template <class Kind>
double measure(const TetMesh& mesh, const std::array<std::uint32_t, std::size_t(Kind::arity)>& vertices) {
  // Relative to the first vertex, like the solvers: at rest C is zero for each of them.
  std::array<glm::dvec3, std::size_t(Kind::arity)> x;
  for (std::size_t j = 0; j < x.size(); ++j) x[j] = mesh.positions[vertices[j]] - mesh.positions[vertices[0]];
  return Kind::template evaluate<double>(x.data(), 0.0).C;
}

template <class Kind, class Vertices>
void measure_all(const TetMesh& mesh, const std::vector<Vertices>& of, ConstraintList& list) {
  constexpr std::size_t arity = std::size_t(Kind::arity);
  list.vertices.resize(of.size() * arity);
  list.rest.resize(of.size());
  parallel_for(of.size(), [&](std::size_t first, std::size_t end) {
    for (std::size_t c = first; c < end; ++c) {
      std::copy_n(of[c].begin(), arity, list.vertices.begin() + std::ptrdiff_t(c * arity));
      list.rest[c] = measure<Kind>(mesh, of[c]);
    }
  });
}

}  // namespace

void Stretch::build(const TetMesh& mesh, ConstraintList& list) {
  measure_all<Stretch>(mesh, tet_edges(mesh), list);
}

void Bend::build(const TetMesh& mesh, ConstraintList& list) {
  // Each directed edge of the surface once; an edge and its opposite make a hinge.
  struct Side {
    std::uint32_t low, high, wing;
    bool forward;
  };
  std::vector<Side> sides;
  sides.reserve(mesh.surface.size() * 3);
  for (const Triangle& t : mesh.surface)
    for (std::size_t c = 0; c < 3; ++c) {
      const std::uint32_t a = t[c], b = t[(c + 1) % 3];
      sides.push_back({std::min(a, b), std::max(a, b), t[(c + 2) % 3], a < b});
    }
  std::sort(sides.begin(), sides.end(), [](const Side& l, const Side& r) {
    return std::tie(l.low, l.high, l.forward, l.wing) < std::tie(r.low, r.high, r.forward, r.wing);
  });
  // A non-manifold edge of four sides (two bodies of tets that touch along it) makes no hinge.
  for (std::size_t i = 0; i < sides.size();) {
    std::size_t end = i;
    while (end < sides.size() && sides[end].low == sides[i].low && sides[end].high == sides[i].high) ++end;
    if (end - i == 2 && sides[i].forward != sides[i + 1].forward) {
      // Wing 0 sees the edge x2 -> x3 run forwards, so a convex hinge has the same sign everywhere.
      const std::array<std::uint32_t, 4> hinge = {sides[i + 1].wing, sides[i].wing, sides[i].low,
                                                  sides[i].high};
      // The clamp of the formula to 1 rad is for errors, not for rest angles: measure the angle itself.
      std::array<glm::dvec3, 4> x;
      for (std::size_t j = 0; j < 4; ++j) x[j] = mesh.positions[hinge[j]] - mesh.positions[hinge[0]];
      list.add(hinge, Formulas<double>{}.hinge_angle(x.data()));
    }
    i = end;
  }
}

void Volume::build(const TetMesh& mesh, ConstraintList& list) { measure_all<Volume>(mesh, mesh.tets, list); }

std::size_t ConstraintSystem::count() const {
  std::size_t sum = 0;
  for (const ConstraintList& list : lists) sum += list.count();
  return sum;
}

ConstraintSystem build_constraints(const TetMesh& mesh, const std::string& names) {
  ConstraintSystem system;
  system.at_vertex.assign(mesh.positions.size(), 0);
  const auto wanted = split(names, ',');
  for_each_kind([&](auto kind, int) {
    ConstraintList list;
    list.arity = kind.row.arity;
    const bool present = std::find(wanted.begin(), wanted.end(), kind.row.name) != wanted.end();
    if (present) kind.build(mesh, list);
    for (std::uint32_t v : list.vertices) ++system.at_vertex[v];
    system.present.push_back(present && list.count() > 0);
    system.lists.push_back(std::move(list));
  });
  return system;
}

}  // namespace tetpbd
