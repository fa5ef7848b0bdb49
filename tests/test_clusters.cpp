// Shape-matching clusters: the rotation, the GPU's integer sums against double, momentum, pins, and what they
// are for.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <glm/gtc/quaternion.hpp>

#include "app/run_loop.h"
#include "sim/metrics.h"
#include "sim/rotation.h"
#include "sim/sim.h"
#include "sim/solvers/clusters.h"
#include "sim/solvers/cpu_pbd.h"
#include "tests/gl_test.h"
#include "tests/mesh_samples.h"

using namespace tetpbd;

namespace {

// Irregular; `bodies` of them, one above the other.
std::shared_ptr<const Model> block_model(glm::ivec3 cells, const std::string& deformation = "none",
                                         glm::dvec3 spin = glm::dvec3(0), int bodies = 1, double height = 0) {
  auto model = std::make_shared<Model>();
  for (int b = 0; b < bodies; ++b) {
    const TetMesh mesh = samples::irregular_block(cells, glm::dvec3(0, 0.36 + b + height, 0));
    auto start = mesh.positions;
    deform(start, mesh, deformation, 1);
    add_body(*model, "block", mesh, 1000, start, glm::dvec3(0), spin, {});
  }
  renumber(*model);
  return model;
}

Settings held(double clusters, int iterations = 1, int substeps = 1) {
  Settings s;
  s.mode = "node";
  s.clusters = clusters;
  s.iterations = iterations;
  s.substeps = substeps;
  return s;
}

double farthest(const std::vector<glm::dvec3>& a, const std::vector<glm::dvec3>& b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) largest = std::max(largest, glm::length(a[i] - b[i]));
  return largest;
}

// Of a free body.
struct Momenta {
  glm::dvec3 centre{0}, velocity{0}, angular{0};
};
Momenta momenta(const Sim& sim) {
  Momenta result;
  const State state = read_state(sim);
  double mass = 0;
  for (std::size_t i = 0; i < state.positions.size(); ++i) {
    const double m = sim.model->masses[i];
    mass += m;
    result.centre += m * state.positions[i];
    result.velocity += m * state.velocities[i];
    result.angular += m * glm::cross(state.positions[i], state.velocities[i]);
  }
  result.centre /= mass;
  result.angular -= glm::cross(result.centre, result.velocity);
  result.velocity /= mass;
  return result;
}

}  // namespace

TEST_CASE("the best rotation is found, also of mirrored and of flat points, and is one whatever comes in") {
  const auto rotation_of = [](const glm::dmat3& A) { return best_rotation(A).R; };
  const auto is_rotation = [](const glm::dmat3& R) {
    double off = std::abs(glm::determinant(R) - 1);
    const glm::dmat3 unit = glm::transpose(R) * R - glm::dmat3(1);
    for (int q = 0; q < 3; ++q) off = std::max(off, glm::length(unit[q]));
    return off;
  };
  for (int k = 0; k < 200; ++k) {
    const double t = k;
    const glm::dmat3 R = glm::mat3_cast(glm::normalize(
        glm::dquat(std::sin(3.1 * t), std::sin(7.7 * t + 1), std::sin(1.3 * t + 2), std::sin(5.9 * t + 3))));
    glm::dmat3 stretch(1 + 0.9 * std::sin(t), 0.2 * std::sin(2 * t), 0.1, 0.2 * std::sin(2 * t), 1.5, -0.2,
                       0.1, -0.2, 0.8);
    const glm::dmat3 found = rotation_of(R * stretch * 1e-7);
    CHECK(is_rotation(found) < 1e-9);
    if (glm::determinant(stretch) > 0.05)
      for (int q = 0; q < 3; ++q) CHECK(glm::length(found[q] - R[q]) < 1e-9);
    // Mirrored in its shortest direction: the other two decide.
    glm::dmat3 mirror(2, 0, 0, 0, 1, 0, 0, 0, -0.5);
    CHECK(glm::length(rotation_of(R * mirror)[0] - R[0]) < 1e-9);
    CHECK(is_rotation(rotation_of(R * mirror)) < 1e-9);
    glm::dmat3 flat(2, 0, 0, 0, 1, 0, 0, 0, 0);
    for (int q = 0; q < 3; ++q) CHECK(glm::length(rotation_of(R * flat)[q] - R[q]) < 1e-9);
  }
  CHECK(is_rotation(rotation_of(glm::dmat3(0))) < 1e-9);
  CHECK(is_rotation(rotation_of(glm::dmat3(1, 0, 0, 0, 0, 0, 0, 0, 0))) < 1e-9);
  CHECK(is_rotation(rotation_of(glm::dmat3(-1))) < 1e-9);
}

TEST_CASE("shares of a vertex make 1, a cluster's weights fit their integers, two bodies share none") {
  const auto model = block_model({8, 6, 4}, "none", glm::dvec3(0), 2);
  const Clusters clusters = build_clusters(*model);
  CHECK(clusters.clusters.size() >= 16);
  for (const glm::vec4& vertex : clusters.rest) {
    int sum = 0;
    for (const layout::Cluster& cluster : clusters.clusters)
      sum += glsl::ShapeMatching{}.cluster_weight(vertex, cluster.node);
    CHECK(std::abs(float(sum) - vertex.w) <= 4);
  }
  for (const layout::Cluster& cluster : clusters.clusters) {
    double weight = 0;
    glm::dvec3 steps(0);
    std::size_t of[2] = {0, 0};
    for (std::size_t v = 0; v < clusters.rest.size(); ++v) {
      glsl::ShapeMatching matching;
      const int w = matching.cluster_weight(clusters.rest[v], cluster.node);
      const glm::ivec3 s = matching.cluster_steps(
          matching.cluster_arm(clusters.rest[v], cluster.centre, cluster.cell), cluster.steps_per_metre);
      weight += w;
      steps += double(w) * glm::dvec3(s);
      of[v >= model->bodies[1].first_vertex] += w > 0;
      if (w > 0) CHECK(glm::length(glm::vec3(s)) < 16384);
      CHECK(w <= 1 << 16);
    }
    CHECK(weight == double(cluster.weight));
    CHECK(weight <= std::exp2(22.0));
    CHECK(steps == glm::dvec3(cluster.steps));
    CHECK(std::min(of[0], of[1]) == 0);
  }
}

TEST_CASE("a step with clusters is the double CPU step, however it is cut, for one body and two") {
  GlTest gl;
  for (const int bodies : {1, 2})
    for (const unsigned patch : {0u, 5u, 64u})
      for (const auto& [iterations, substeps] : {std::pair(1, 3), std::pair(3, 2)})
        for (const char* how : {"stretch:1.1", "twist:15"}) {
          CAPTURE(bodies);
          CAPTURE(patch);
          CAPTURE(how);
          const auto model = block_model({5, 4, 3}, how, glm::dvec3(1, 2, 3), bodies);
          Sim sim = create_sim(model, held(0.7, iterations, substeps), {.patch = patch});
          CpuPbd<double> pbd(*model, sim.system);
          State expected = read_state(sim);
          const State before = expected;
          for (int s = 0; s < 3; ++s)
            pbd.step(expected, sim.settings, sim.inverse_masses, Sweep::jacobi), step(sim);
          const State after = read_state(sim);
          CHECK(farthest(after.positions, expected.positions) < 2e-5 * model->size);
          CHECK(farthest(after.positions, before.positions) > 1e-2);
        }
}

TEST_CASE("clusters keep momentum, linear and angular, over 400 steps of free flight") {
  GlTest gl;
  for (const double strength : {0.0, 0.8}) {
    CAPTURE(strength);
    Settings settings = held(strength, 1, 25);
    settings.gravity = 0, settings.ground = false, settings.mass_splitting = true;
    Sim sim = create_sim(block_model({5, 4, 3}, "stretch:1.02", glm::dvec3(0, 4, 1)), settings);
    const Momenta before = momenta(sim);
    for (int s = 0; s < 400; ++s) step(sim);
    const Momenta after = momenta(sim);
    const double time = 400 * settings.dt;
    CHECK(glm::length(after.centre - before.centre - time * before.velocity) < 1e-5 * sim.model->size);
    CHECK(glm::length(after.angular - before.angular) < 0.01 * glm::length(before.angular));
  }
}

TEST_CASE("at rest clusters pull nowhere") {
  GlTest gl;
  Settings settings = held(0.8, 1, 1);
  settings.gravity = 0, settings.ground = false, settings.omega = 0;
  const auto model = block_model({4, 3, 2});
  const Clusters clusters = build_clusters(*model);
  double largest = 0;
  for (const glm::dvec3& pull : cluster_pulls(clusters, model->positions))
    largest = std::max(largest, glm::length(pull));
  Sim sim = create_sim(model, settings);
  step(sim);
  const double moved = farthest(read_state(sim).positions, model->positions);
  MESSAGE("double pulls by " << largest << " m, the GPU by " << moved);
  CHECK(largest < 1e-7 * model->size);
  CHECK(moved < 1e-7 * model->size);
}

TEST_CASE("what rests with clusters stays at rest, floating and standing") {
  GlTest gl;
  Settings settings = held(0.8, 1, 5);
  settings.gravity = 0, settings.ground = false;
  const auto model = block_model({4, 3, 2});
  Sim floating = create_sim(model, settings);
  for (int s = 0; s < 100; ++s) step(floating);
  CHECK(farthest(read_state(floating).positions, model->positions) < 1e-6);
  TetMesh mesh = make_block(glm::dvec3(1.0, 0.5, 0.5), {4, 2, 2});
  for (auto& p : mesh.positions) p.y += 0.25;
  auto lying = std::make_shared<Model>();
  add_body(*lying, "block", mesh, 1000, mesh.positions, glm::dvec3(0), glm::dvec3(0), {});
  Sim standing = create_sim(lying, held(0.8, 1, 5));
  for (int s = 0; s < 200; ++s) step(standing);
  const State settled = read_state(standing);
  for (int s = 0; s < 100; ++s) step(standing);
  CHECK(farthest(read_state(standing).positions, settled.positions) < 1e-4);
  CHECK(farthest(settled.positions, mesh.positions) < 0.01);
}

TEST_CASE(
    "clusters lose less volume in a fall than iterations of the same number, and recover from a point") {
  GlTest gl;
  const auto model = block_model({8, 6, 4}, "none", glm::dvec3(0), 1, 1);
  const auto loss = [&](double clusters) {
    Sim sim = create_sim(model, held(clusters, 1, 8));
    Metrics metrics = create_metrics(*model);
    const RunErrors errors = run_loop(sim, &metrics, 120).errors;
    CHECK(errors.finite);
    return errors.max_volume_loss_percent;
  };
  const double without = loss(0), with = loss(0.8);
  MESSAGE("largest loss " << without << " %, with clusters " << with << " %");
  CHECK(with < 0.5 * without);
  for (const char* how : {"point", "line", "flatten", "random", "mirror", "stretch:10"}) {
    CAPTURE(how);
    Sim sim = create_sim(block_model({5, 4, 3}, how), held(0.8, 1, 10));
    for (int s = 0; s < 60; ++s) step(sim);
    Metrics metrics = create_metrics(*sim.model);
    CHECK(std::abs(measure_now(metrics, sim).volume_error_percent) < 2);
  }
}

TEST_CASE(
    "a pinned vertex leads its clusters; clusters come and go while running; the same run gives the same "
    "bits") {
  GlTest gl;
  const auto run = [&] {
    Sim sim = create_sim(block_model({5, 4, 3}), held(0.8, 1, 5));
    for (int s = 0; s < 5; ++s) step(sim);
    const glm::dvec3 at = read_state(sim).positions[0];
    pin(sim, 0);
    for (int s = 1; s <= 100; ++s) move_pinned(sim, 0, at + glm::dvec3(0, 0.02 * s, 0)), step(sim);
    glm::dvec3 middle(0);
    const State pulled = read_state(sim);
    for (const auto& p : pulled.positions) middle += p / double(pulled.positions.size());
    CHECK(glm::length(pulled.positions[0] - at - glm::dvec3(0, 2, 0)) < 1e-6);
    CHECK(glm::length(pulled.positions[0] - middle) < 1.5);
    unpin(sim, 0);
    const std::size_t before = sim.solver.buffers.size();
    Settings without = sim.settings;
    without.clusters = 0;
    apply_settings(sim, without);
    CHECK(sim.solver.buffers.size() < before);
    CHECK(farthest(read_state(sim).positions, pulled.positions) == 0);
    step(sim);
    apply_settings(sim, held(0.5, 2, 2));
    for (int s = 0; s < 5; ++s) step(sim);
    return state_hash(sim);
  };
  CHECK(run() == run());
}
