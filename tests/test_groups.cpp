// Mode groups: balanced, complete, a colouring where there are enough; its step.
#include <doctest/doctest.h>

#include <algorithm>

#include "sim/reference/reference.h"
#include "sim/solvers/groups.h"
#include "tests/gl_test.h"
#include "tests/group_of.h"
#include "tests/sim_samples.h"

using namespace samples;

namespace {

// One step of mode groups in double: CpuPbd's averages over each group (omega 1 and nothing else of a step),
// of which a vertex with n constraints in the group goes min(n, omega) times; contacts after the last group.
State step_by_groups(const Sim& sim) {
  const Settings& s = sim.settings;
  const auto groups = balanced_groups(sim.system, s.groups);
  std::vector<ConstraintSystem> parts;
  for (int g = 0; g < s.groups; ++g) parts.push_back(group_of(sim.system, groups, g));
  Settings average = s;
  average.iterations = average.substeps = 1, average.omega = 1, average.gravity = 0, average.ground = false;
  const double h = s.dt / s.substeps;
  State state = read_state(sim);
  auto& x = state.positions;
  for (int substep = 0; substep < s.substeps; ++substep) {
    for (std::size_t i = 0; i < x.size(); ++i) {
      state.velocities[i].y -= h * s.gravity;
      x[i] += h * state.velocities[i];
    }
    const auto predicted = x;
    for (int iteration = 0; iteration < s.iterations; ++iteration) {
      for (const ConstraintSystem& part : parts) {
        State moved{x, std::vector<glm::dvec3>(x.size())};
        CpuPbd<double>(*sim.model, part).step(moved, average, sim.inverse_masses, Sweep::jacobi);
        for (std::size_t i = 0; i < x.size(); ++i)
          x[i] += (moved.positions[i] - x[i]) * std::min(double(part.at_vertex[i]), s.omega);
      }
      for (std::size_t i = 0; i < x.size(); ++i)
        if (const double depth = x[i].y - s.ground_height; depth < 0)
          x[i] += Formulas<double>{}.plane_correction(
              glm::dvec3(0, 1, 0), depth, h * state.velocities[i] + (x[i] - predicted[i]), s.friction);
    }
    for (std::size_t i = 0; i < x.size(); ++i) state.velocities[i] += (x[i] - predicted[i]) / h;
  }
  return state;
}

}  // namespace

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

TEST_CASE("one step of mode groups is Gauss-Seidel between groups in double, averaged inside each") {
  GlTest gl;
  for (glm::ivec3 cells : {glm::ivec3(1, 1, 1), glm::ivec3(4, 3, 2)})
    for (int groups : {1, 3, 8, 128})  // the last is a colouring
      for (int iterations : {1, 3})
        for (unsigned patch : {0u, 5u}) {
          CAPTURE(cells.x);
          CAPTURE(groups);
          CAPTURE(iterations);
          CAPTURE(patch);
          Settings settings = quick("groups", iterations, 2);
          settings.groups = groups;
          Sim sim = create_sim(block_model(cells, -0.01, 1, "stretch:1.3", glm::dvec3(0, 2, 0)), settings,
                               {.patch = patch});
          const State expected = step_by_groups(sim), before = read_state(sim);
          step(sim);
          const State after = read_state(sim);
          CHECK(distance(after, expected) < 2e-6 * sim.model->size);
          CHECK(distance(State{after.velocities, {}}, State{expected.velocities, {}}) < 1e-3);
          CHECK(distance(after, before) > 1e-3);
        }
}

TEST_CASE(
    "one group is mode node, many groups come closer to Gauss-Seidel, and the setting takes effect at once") {
  GlTest gl;
  const auto model = block_model({4, 3, 2}, 0.2, 1, "stretch:1.1");
  Settings settings = quick("node");
  settings.gravity = 0, settings.ground = false;
  Sim node = create_sim(model, settings);
  settings.mode = "groups", settings.groups = 1;
  Sim sim = create_sim(model, settings);
  const State start = read_state(sim);
  const State exact = rigid_step({*model, sim.system, settings, sim.inverse_masses}, start);
  step(node), step(sim);
  CHECK(distance(read_state(sim), read_state(node)) < 1e-7);
  double previous = 1;
  for (int groups : {1, 4, 16, 128}) {
    CAPTURE(groups);
    settings.groups = groups;
    apply_settings(sim, settings);
    write_state(sim, start);
    step(sim);
    const double left = error_to(*model, exact, read_state(sim)) / error_to(*model, exact, start);
    MESSAGE(groups << " groups leave " << left << " of the stretch");
    CHECK(left < previous);
    previous = left;
    Sim fresh = create_sim(model, settings);
    step(fresh);
    CHECK(state_hash(fresh) == state_hash(sim));
  }
}
