// Balanced groups of constraints, for Gauss-Seidel between groups and averaging inside one.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "sim/constraints.h"

namespace tetpbd {

/// By kind, which of `groups` each constraint is in: the one that its vertices use least so far, all kinds
/// mixed. With groups enough (about the largest number of constraints on a vertex) no vertex has two
/// constraints in one: a colouring. Deterministic.
std::vector<std::vector<std::uint8_t>> balanced_groups(const ConstraintSystem& system, int groups);

}  // namespace tetpbd
