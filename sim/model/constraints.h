// The constraints of a mesh, in one list per kind.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "sim/mesh/tet_mesh.h"
#include "sim/model/averages.h"
#include "sim/model/constraint_kinds.h"

namespace tetpbd {

/// Constraints of one kind: each has `arity` vertices and the kind's rest values (a single one in m, rad or m^3).
struct ConstraintList {
  int arity = 0;
  std::vector<std::uint32_t> vertices;  ///< arity * count
  std::vector<double> rest;
  std::vector<double> compliance{};            ///< by component, of a material; empty: the settings' compliance
  std::vector<double> stiffness{}, damping{};  ///< k, and s, where bodies differ; empty: those of the settings
  /// The damping of constraint c in seconds; `all` is that of lists without their own.
  double damping_at(std::size_t c, double all) const { return damping.empty() ? all : damping[c]; }
  std::size_t count() const { return vertices.size() / std::size_t(std::max(arity, 1)); }
  /// The vertices of constraint c.
  std::span<const std::uint32_t> ends(std::size_t c) const {
    return std::span(vertices).subspan(c * std::size_t(arity), std::size_t(arity));
  }
  /// Appends constraint c of a list of the same kind.
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

struct ConstraintSystem {
  std::vector<ConstraintList> lists;     ///< one per kind, empty for a kind left out
  std::vector<bool> present;             ///< by kind, whether its list has any
  std::vector<std::uint32_t> at_vertex;  ///< n_i, constraints of all kinds on vertex i
  Averages averages{};                   ///< of smoothed tets
  std::size_t count() const;
};
/// Whether tets are smoothed, so that there are averages.
inline bool has_averages(const ConstraintSystem& system) { return !system.averages.vertices.empty(); }
/// The constraints of a mesh of the kinds that `names` ("stretch,volume") lists.
ConstraintSystem build_constraints(const TetMesh& mesh, const std::string& names);

}  // namespace tetpbd
