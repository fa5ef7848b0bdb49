// Groups of constraints: balanced, complete, and a colouring where there are enough.
#include <doctest/doctest.h>

#include <algorithm>

#include "sim/solvers/groups.h"
#include "tests/group_of.h"

using namespace tetpbd;

TEST_CASE("groups share a vertex's constraints out evenly and lose none") {
  const TetMesh mesh = make_block({1, 1, 1}, {4, 3, 2});
  const ConstraintSystem system = build_constraints(mesh, "stretch,bend,volume");
  for (int count : {1, 4, 8}) {
    CAPTURE(count);
    const auto groups = balanced_groups(system, count);
    std::vector<std::uint32_t> sum(system.at_vertex.size());
    std::size_t members = 0;
    for (int g = 0; g < count; ++g) {
      const ConstraintSystem part = group_of(system, groups, g);
      members += part.count();
      for (std::size_t i = 0; i < sum.size(); ++i) {
        sum[i] += part.at_vertex[i];
        // An even share, give or take: greedy is not perfect.
        CHECK(part.at_vertex[i] <= 2 * (system.at_vertex[i] / std::uint32_t(count)) + 2);
      }
    }
    CHECK(members == system.count());
    CHECK(sum == system.at_vertex);
  }
}

TEST_CASE("enough groups are a colouring") {
  const TetMesh mesh = make_block({1, 1, 1}, {3, 3, 3});
  const ConstraintSystem system = build_constraints(mesh, "stretch,bend,volume");
  const auto groups = balanced_groups(system, 128);
  for (int g = 0; g < 128; ++g) {
    const ConstraintSystem part = group_of(system, groups, g);
    CHECK(*std::max_element(part.at_vertex.begin(), part.at_vertex.end()) <= 1);
  }
  CHECK(balanced_groups(system, 8) == balanced_groups(system, 8));
}
