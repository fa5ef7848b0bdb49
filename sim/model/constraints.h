// The constraints of a mesh: one list per kind.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "sim/mesh/tet_mesh.h"
#include "sim/model/constraint_kinds.h"

namespace tetpbd {

/// Constraints of one kind: `arity` vertices and the kind's rest values each (m, rad or m^3 where there is
/// one), from positions in double.
struct ConstraintList {
  int arity = 0;
  std::vector<std::uint32_t> vertices;  ///< arity * count
  std::vector<double> rest;
  std::vector<double> compliance{};            ///< of a material, the kind's components each; else empty: the settings'
  std::vector<double> stiffness{}, damping{};  ///< k and s, where bodies differ; else empty: the settings'
  /// s, of constraint c, where it resists its rate; `all`: of those that have none of their own.
  double damping_at(std::size_t c, double all) const { return damping.empty() ? all : damping[c]; }
  std::size_t count() const { return vertices.size() / std::size_t(std::max(arity, 1)); }
  std::span<const std::uint32_t> ends(std::size_t c) const {  ///< of constraint c
    return std::span(vertices).subspan(c * std::size_t(arity), std::size_t(arity));
  }
  /// Constraint c of a list of the same kind.
  void add(const ConstraintList& from, std::size_t c) {
    const auto append = [&](auto& to, const auto& values) {
      const std::size_t each = values.size() / from.count();
      const auto first = values.begin() + std::ptrdiff_t(c * each);
      to.insert(to.end(), first, first + std::ptrdiff_t(each));
    };
    append(vertices, from.vertices), append(rest, from.rest), append(compliance, from.compliance);
    append(stiffness, from.stiffness), append(damping, from.damping);
  }
};

/// The constraints of a mesh of the kinds that `names` ("stretch,volume") lists.
struct ConstraintSystem {
  std::vector<ConstraintList> lists;     ///< one per kind, empty for a kind left out
  std::vector<bool> present;             ///< by kind
  std::vector<std::uint32_t> at_vertex;  ///< n_i, constraints of all kinds on vertex i
  std::size_t count() const;
};
ConstraintSystem build_constraints(const TetMesh& mesh, const std::string& names);

}  // namespace tetpbd
