// Mode gauss-seidel: its clusters and colours, its arithmetic against double, and what Gauss-Seidel keeps.
#include <doctest/doctest.h>

#include <algorithm>
#include <set>

#include "sim/snapshot.h"
#include "sim/solvers/clusters.h"
#include "sim/solvers/cpu_pbd.h"
#include "tests/gl_test.h"
#include "tests/sim_samples.h"

using namespace samples;

namespace {

// What project() asks for, in double.
struct Places {
  std::vector<glm::dvec3>& x;
  const std::vector<glm::dvec3>& starts;
  const std::vector<double>& weights;
  const glm::dvec3& at(std::uint32_t v) const { return x[v]; }
  const glm::dvec3& start(std::uint32_t v) const { return starts[v]; }
  double weight(std::uint32_t v) const { return weights[v]; }
  void move(std::uint32_t v, const glm::dvec3& by) const { x[v] += by; }
};

void project_one(const Sim& sim, const ConstraintRef& ref, double* multipliers, const Places& places) {
  const ConstraintList& list = sim.system.lists[ref.kind];
  GuardCounts guards{};
  for_each_kind([&](auto kind, int number) {
    if (number != int(ref.kind)) return;
    using Kind = decltype(kind);
    Rule<double> rule(sim.settings, sim.plan.h, ref.kind, sim.model->size);
    const std::size_t c = ref.constraint;
    if (!list.stiffness.empty()) rule.set(list.stiffness[c], list.damping[c], Kind::row);
    const double* compliance =
        list.compliance.empty() ? nullptr : list.compliance.data() + c * std::size_t(Kind::row.components);
    project<Kind>(list.ends(c).data(), list.rest.data() + c * std::size_t(Kind::row.values), compliance, rule,
                  multipliers, places, guards);
  });
}

// A step in double without a GPU, in the order of the clusters.
State reference_step(const Sim& sim) {
  const Clusters clusters = cluster_constraints(sim.system, Clusters::usual);
  State state = read_state(sim);
  auto& x = state.positions;
  const Plan& plan = sim.plan;
  Substep substep(*sim.model, sim.settings, plan, 0);
  for (int s = 0; s < plan.substeps; ++s) {
    const std::vector<glm::dvec3> start = x;
    for (std::size_t i = 0; i < x.size(); ++i)
      if (sim.inverse_masses[i] > 0) x[i] = substep.predict(i, x[i], state.velocities[i]);
    const std::vector<glm::dvec3> predicted = x;
    std::vector<std::array<double, 2>> multipliers(sim.system.count());
    for (int iteration = 0; iteration < plan.iterations; ++iteration) {
      std::size_t n = 0;
      for (const auto& members : clusters.members)
        for (const ConstraintRef& ref : members)
          project_one(sim, ref, multipliers[n++].data(), {x, start, sim.inverse_masses});
      for (std::size_t i = 0; i < x.size(); ++i)
        if (sim.inverse_masses[i] > 0) x[i] = substep.out_of_obstacles(i, x[i], predicted[i], state.velocities[i]);
    }
    for (std::size_t i = 0; i < x.size(); ++i)
      if (sim.inverse_masses[i] > 0) state.velocities[i] += (x[i] - predicted[i]) / plan.h;
  }
  return state;
}

Settings sweeping(int iterations, int substeps) {
  Settings settings = quick("gauss-seidel", iterations, substeps);
  settings.rigid_contact = false;
  return settings;
}

double volume(const Model& model, const State& state) {
  double sum = 0;
  for (const Tet& t : model.rest.tets) {
    const auto side = [&](int j) { return state.positions[t[std::size_t(j)]] - state.positions[t[0]]; };
    sum += glm::dot(glm::cross(side(1), side(2)), side(3)) / 6;
  }
  return sum;
}

}  // namespace

TEST_CASE("clusters of a colour share no vertex, every constraint is in one, and clusters need fewer colours") {
  const TetMesh mesh = make_block({1, 1, 1}, {7, 6, 5});
  const ConstraintSystem system = build_constraints(mesh, "stretch,bend,volume");
  std::size_t colours_of_single = 0;
  for (const std::size_t most : {1, 4, 16, 32}) {
    CAPTURE(most);
    const Clusters clusters = cluster_constraints(system, most);
    std::set<ConstraintRef> all;
    for (std::size_t colour = 0; colour + 1 < clusters.first.size(); ++colour) {
      std::set<std::uint32_t> used;
      for (std::size_t k = clusters.first[colour]; k < clusters.first[colour + 1]; ++k) {
        std::set<std::uint32_t> own;
        CHECK(clusters.members[k].size() <= most);
        CHECK(std::ranges::is_sorted(clusters.members[k]));
        for (const ConstraintRef& ref : clusters.members[k]) {
          CHECK(all.insert(ref).second);
          for (const std::uint32_t v : system.lists[ref.kind].ends(ref.constraint)) own.insert(v);
        }
        for (const std::uint32_t v : own) CHECK(used.insert(v).second);
      }
      CHECK(!used.empty());
    }
    CHECK(all.size() == system.count());
    const std::size_t colours = clusters.first.size() - 1;
    MESSAGE(most << " constraints a cluster: " << clusters.members.size() << " clusters, " << colours << " colours");
    if (most == 1) colours_of_single = colours;
    if (most == 16) CHECK(2 * colours < colours_of_single);
  }
}

TEST_CASE("a step of mode gauss-seidel is that in double, one constraint after the other in the order of clusters") {
  GlTest gl;
  double worst = 0;
  for (const char* kinds : {"stretch", "bend", "volume", "stretch,bend,volume", "stretch,isobend,volume"})
    for (const double tau : {-1.0, 0.0, 2e-3}) {  // -1: hard
      CAPTURE(kinds);
      CAPTURE(tau);
      Settings settings = sweeping(3, 2);
      settings.constraints = kinds;
      if (tau >= 0) {
        settings.compliance[index_of<Stretch>] = 1e-6, settings.compliance[index_of<Bend>] = 1e-4;
        settings.compliance[index_of<Isobend>] = 1e-4, settings.compliance[index_of<Volume>] = 1e-10;
        settings.constraint_damping = tau;
      }
      Sim sim = create_sim(block_model({5, 4, 3}, -0.01, 1, "stretch:1.1"), settings);
      const State before = read_state(sim), expected = reference_step(sim);
      step(sim);
      const State after = read_state(sim);
      worst = std::max(worst, distance(after, expected));
      CHECK(distance(after, expected) < 2e-6);
      CHECK(distance(after, before) > 1e-3);
    }
  MESSAGE("largest distance to double: " << worst << " m");
}

TEST_CASE("a neo-Hookean step of mode gauss-seidel with dashpots is that in double") {
  GlTest gl;
  Settings settings = sweeping(3, 2);
  settings.material = "neo-hookean", settings.young_modulus = 1e5, settings.poisson_ratio = 0.45;
  settings.viscosity = 50;
  Sim sim = create_sim(block_model({5, 4, 3}, -0.01, 1, "stretch:1.1"), settings);
  const State before = read_state(sim), expected = reference_step(sim);
  step(sim);
  CHECK(distance(read_state(sim), expected) < 2e-6);
  CHECK(distance(read_state(sim), before) > 1e-3);
}

TEST_CASE("mode gauss-seidel gives the same bits twice, and through a snapshot") {
  GlTest gl;
  const auto model = block_model({5, 4, 3}, 0.02, 1, "random");
  Settings settings = sweeping(2, 3);
  Sim a = create_sim(model, settings), b = create_sim(model, settings);
  for (int s = 0; s < 5; ++s) step(a), step(b);
  const Buffer kept("kept", snapshot_bytes(a));
  const Snapshot snapshot = take_snapshot(a, kept, 0);
  for (int s = 0; s < 5; ++s) step(a), step(b);
  const std::uint64_t bits = state_hash(a);
  CHECK(state_hash(b) == bits);
  restore_snapshot(a, snapshot, kept);
  CHECK(state_hash(a) != bits);
  for (int s = 0; s < 5; ++s) step(a);
  CHECK(state_hash(a) == bits);
}

TEST_CASE("mode gauss-seidel loses less volume than mode node with as many iterations") {
  GlTest gl;
  double most[2];
  for (const bool sweeps : {false, true}) {
    Settings settings = quick(sweeps ? "gauss-seidel" : "node", 2, 5);
    settings.rigid_contact = false;
    Sim sim = create_sim(block_model({6, 5, 4}, 0.3), settings);
    const double whole = volume(*sim.model, {sim.model->rest.positions, {}});
    double& lost = most[sweeps] = 0;
    for (int s = 0; s < 80; ++s) step(sim), lost = std::max(lost, 1 - volume(*sim.model, read_state(sim)) / whole);
  }
  MESSAGE("most volume lost: node " << most[0] << ", gauss-seidel " << most[1]);
  CHECK(most[0] > 1e-4);
  CHECK(most[1] < 0.5 * most[0]);
}

TEST_CASE("mode gauss-seidel keeps the momentum of a free body, its turning as mode cpu does, and pinned vertices") {
  GlTest gl;
  for (const bool soft : {false, true}) {
    CAPTURE(soft);
    glm::dvec3 turning[2] = {glm::dvec3(0), glm::dvec3(0)};
    for (const bool on_cpu : {false, true}) {
      Settings settings = sweeping(3, 2);
      if (on_cpu) settings.mode = "cpu-double";
      settings.gravity = 0, settings.ground = false;
      if (soft) settings.compliance[index_of<Stretch>] = 1e-6, settings.constraint_damping = 2e-3;
      Sim sim = create_sim(block_model({5, 4, 3}, 1, 1, "none", {0, 2, 1}), settings);
      for (int s = 0; s < 100; ++s) step(sim);
      glm::dvec3 momentum(0);
      const State state = read_state(sim);
      for (std::size_t i = 0; i < state.velocities.size(); ++i) {
        const glm::dvec3 own = sim.model->masses[i] * state.velocities[i];
        momentum += own, turning[on_cpu] += glm::cross(state.positions[i], own);
      }
      CHECK(glm::length(momentum) < 1e-4);  // kg m/s, of a body of 350 kg
      if (on_cpu) continue;

      const VertexList pinned = {0, 7, 9};
      pin(sim, pinned);
      for (int s = 0; s < 20; ++s) step(sim);
      const State later = read_state(sim);
      for (const std::uint32_t v : pinned) CHECK(state.positions[v] == later.positions[v]);
      CHECK(distance(state, later) > 1e-3);
    }
    MESSAGE("angular momentum after 100 steps, kg m^2/s: " << glm::length(turning[0]) << ", mode cpu-double "
                                                           << glm::length(turning[1]));
    CHECK(glm::length(turning[0] - turning[1]) < 0.02 * glm::length(turning[1]));
  }
}
