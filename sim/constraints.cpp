#include "sim/constraints.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "sim/error.h"

namespace tetpbd {

namespace {

template <class Kind>
double measure(const TetMesh& mesh, const std::array<std::uint32_t, std::size_t(Kind::arity)>& vertices) {
  // Relative to the first vertex, like the solvers: at rest C is zero for each of them.
  std::array<glm::dvec3, std::size_t(Kind::arity)> x;
  for (std::size_t j = 0; j < x.size(); ++j) x[j] = mesh.positions[vertices[j]] - mesh.positions[vertices[0]];
  return Kind::template evaluate<double>(x.data(), 0.0).C;
}

}  // namespace

void Stretch::build(const TetMesh& mesh, ConstraintList& list) {
  for (const auto& edge : tet_edges(mesh)) list.add(edge, measure<Stretch>(mesh, edge));
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

void Volume::build(const TetMesh& mesh, ConstraintList& list) {
  for (const Tet& tet : mesh.tets) list.add(tet, measure<Volume>(mesh, tet));
}

const std::vector<ConstraintKind>& constraint_kinds() {
  static const std::vector<ConstraintKind> rows = [] {
    std::vector<ConstraintKind> result;
    for_each_kind([&](auto kind, int) { result.push_back({kind.name, kind.arity, kind.stiffness}); });
    return result;
  }();
  return rows;
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
  for_each_kind([&](auto kind, int) {
    ConstraintList list;
    list.arity = kind.arity;
    const bool present = std::find(wanted.begin(), wanted.end(), kind.name) != wanted.end();
    if (present) kind.build(mesh, list);
    for (std::uint32_t v : list.vertices) ++system.at_vertex[v];
    system.present.push_back(present && list.count() > 0);
    system.lists.push_back(std::move(list));
  });
  return system;
}

std::vector<std::uint32_t> vertex_adjacency(const ConstraintSystem& system) {
  const std::size_t vertices = system.at_vertex.size();
  std::vector<const ConstraintList*> lists;
  std::size_t entries = 0;
  for (std::size_t k = 0; k < system.lists.size(); ++k)
    if (system.present[k]) lists.push_back(&system.lists[k]), entries += system.lists[k].vertices.size();
  std::vector<std::uint32_t> table(lists.size() * (vertices + 1) + entries);
  if (table.size() > (std::size_t(1) << 32) - 1)
    throw Error("too many constraints", fmt::format("{} of them", system.count()), "use a smaller mesh");
  std::uint32_t next = std::uint32_t(lists.size() * (vertices + 1));
  for (std::size_t k = 0; k < lists.size(); ++k) {
    const ConstraintList& list = *lists[k];
    std::uint32_t* offsets = table.data() + k * (vertices + 1);
    for (std::uint32_t v : list.vertices) ++offsets[v + 1];
    offsets[0] = next;
    for (std::size_t i = 0; i < vertices; ++i) offsets[i + 1] += offsets[i];
    next = offsets[vertices];
    std::vector<std::uint32_t> cursor(offsets, offsets + vertices);
    const std::size_t arity = std::size_t(list.arity);
    for (std::size_t c = 0; c < list.count(); ++c)
      for (std::size_t j = 0; j < arity; ++j)
        table[cursor[list.vertices[c * arity + j]]++] = std::uint32_t(4 * c + j);
  }
  return table;
}

}  // namespace tetpbd
