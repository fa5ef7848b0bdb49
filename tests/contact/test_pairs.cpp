// Contact of bodies with each other and themselves: momentum, depth, friction, rest; the GPU against double.
#include <doctest/doctest.h>

#include <cmath>
#include <glm/gtc/constants.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <random>

#include "app/lab/run.h"
#include "render/renderer.h"
#include "sim/contact/obstacle_kinds.h"
#include "sim/contact/starts.h"
#include "sim/measure/crossings.h"
#include "sim/measure/overlap.h"
#include "sim/reference/motion.h"
#include "sim/sim.h"
#include "tests/gl_test.h"
#include "tests/long_run.h"
#include "tests/reference/reference_scenes.h"
#include "tests/sim_samples.h"

using namespace tetpbd;
using reference_scenes::centre_of;

namespace {

struct Placed {
  glm::dvec3 at{0}, velocity{0}, spin{0};
  std::vector<std::uint32_t> fixed{};
  glm::dvec3 size{0.5};
  glm::ivec3 cells{4};
  bool round = false;  // a ball across which the block was
  glm::dmat3 turn{1};
};

std::shared_ptr<const Model> blocks(const std::vector<Placed>& all, bool apart = true) {
  auto model = std::make_shared<Model>();
  for (const Placed& one : all) {
    TetMesh mesh = make_block(one.size, one.cells);
    for (glm::dvec3& p : mesh.positions)
      if (const double l = glm::length(p); one.round && l > 0)
        p *= std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)}) / l;
    finish_tets(mesh, "block");
    auto start = mesh.positions;
    for (auto& p : start) p = one.turn * p + one.at;
    add_body(*model, "block", mesh, 1000, start, one.velocity, one.spin, one.fixed);
  }
  Settings settings;  // as a scene would start
  settings.contact = "bodies", settings.ground = false;
  if (apart) separate_starts(*model, settings);
  return model;
}

Settings touching(const std::string& mode, double young_modulus = 2e5) {
  Settings s;
  s.mode = mode, s.contact = "bodies", s.material = "neo-hookean", s.young_modulus = young_modulus;
  s.poisson_ratio = 0.4, s.gravity = 0, s.ground = false, s.friction = 0;
  s.substeps = solver_mode(s).leapfrog ? automatic : 20;
  return s;
}

struct Momenta {
  glm::dvec3 momentum{0}, spin{0};
  double energy = 0;
};
Momenta motion_of(const Sim& sim) {
  const State state = read_state(sim);
  Momenta sum;
  for (std::size_t i = 0; i < state.positions.size(); ++i) {
    const glm::dvec3 p = sim.model->masses[i] * state.velocities[i];
    sum.momentum += p, sum.spin += glm::cross(state.positions[i], p);
    sum.energy += 0.5 * glm::dot(p, state.velocities[i]);
  }
  return sum;
}
double speed_of(const Sim& sim, std::size_t body, glm::length_t axis) {
  const State state = read_state(sim);
  const Body& b = sim.model->bodies[body];
  double mass = 0, momentum = 0;
  for (std::size_t i = b.first_vertex; i < b.first_vertex + b.vertices; ++i)
    mass += sim.model->masses[i], momentum += sim.model->masses[i] * state.velocities[i][axis];
  return momentum / mass;
}

}  // namespace

TEST_CASE("pairs: proximity is the least distance of points, and its weights give the points") {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> unit(-1, 1);
  const auto point = [&] { return glm::dvec3(unit(random), unit(random), unit(random)); };
  Formulas<double> f;
  constexpr int parts = 40;
  for (int round = 0; round < 200; ++round) {
    const glm::dvec3 a = point(), b = point(), c = point();
    const auto of_triangle = f.vertex_triangle_proximity(a, b, c), of_edges = f.edge_edge_proximity(a, b, c);
    double to_triangle = 1e30, to_edge = 1e30;  // of points on a lattice, which are no nearer
    for (int i = 0; i <= parts; ++i)
      for (int j = 0; j <= parts; ++j) {
        const double s = double(i) / parts, t = double(j) / parts;
        if (i + j <= parts) to_triangle = std::min(to_triangle, glm::length((1 - s - t) * a + s * b + t * c));
        to_edge = std::min(to_edge, glm::length(s * a - (1 - t) * b - t * c));
      }
    for (const auto& [near, lattice] : {std::pair(of_triangle, to_triangle), std::pair(of_edges, to_edge)}) {
      CHECK(near.distance <= lattice + 1e-12);
      CHECK(near.distance > lattice - 2.0 / parts);
      const glm::dvec3 to = near.weights[1] * a + near.weights[2] * b + near.weights[3] * c;
      CHECK(glm::length(to - near.distance * near.normal) < 1e-12);
      CHECK(std::abs(near.weights[0] + near.weights[1] + near.weights[2] + near.weights[3]) < 1e-12);
    }
  }
}

TEST_CASE("pairs: edges that cross stop each other, in every mode (long)") {
  GlTest gl;
  const double r = std::sqrt(0.5);
  Placed ridge{{0, 0, 0}}, keel{{0.07, 0.72, 0.09}, {0, -1, 0}};
  ridge.turn = glm::dmat3(1, 0, 0, 0, r, r, 0, -r, r), keel.turn = glm::dmat3(r, r, 0, -r, r, 0, 0, 0, 1);
  ridge.cells = keel.cells = glm::ivec3(2);
  const auto model = blocks({ridge, keel});
  for (const std::string mode : {"explicit", "node", "newton", "cpu-double", "cpu-fast"}) {
    CAPTURE(mode);
    Settings settings = touching(mode, 1e6);
    if (mode == "newton") settings.iterations = 8, settings.substeps = 5;
    Sim sim = create_sim(model, settings);
    const Momenta before = motion_of(sim);
    double lowest = 1;
    for (int s = 0; s < 40; ++s) {
      step(sim);
      const State state = read_state(sim);
      double crest = -1, under = 1;
      for (std::size_t i = 0; i < state.positions.size(); ++i)
        if (i < model->bodies[1].first_vertex)
          crest = std::max(crest, state.positions[i].y);
        else
          under = std::min(under, state.positions[i].y);
      lowest = std::min(lowest, under - crest);
    }
    REQUIRE_FALSE(check_finite(sim, true));
    CHECK(lowest > -0.05);  // edges are 0.25 m long, and bend
    CHECK(speed_of(sim, 0, 1) < speed_of(sim, 1, 1));
    CHECK(glm::length(motion_of(sim).momentum - before.momentum) < 1e-5 * glm::length(before.momentum));
    CHECK(motion_of(sim).energy < 1.001 * before.energy);
  }
}

TEST_CASE("pairs: two bodies that collide keep their momentum, part again and gain no energy (long)") {
  GlTest gl;
  const auto model = blocks({{{0, 0, 0}, {2, 0, 0}}, {{0.7, 0.13, 0.08}, {-1, 0, 0}, {0, 0, 2}}});
  std::vector<double> speeds;
  for (const std::string mode : {"cpu-double", "node", "constraint", "explicit", "cpu-fast", "newton"}) {
    // Other tests compare these two with node and cpu-double.
    if (!is_long_run() && (mode == "constraint" || mode == "cpu-fast")) continue;
    CAPTURE(mode);
    Settings settings = touching(mode);
    if (mode == "newton") settings.iterations = 8, settings.substeps = 5;  // 20 near another body
    Sim sim = create_sim(model, settings);
    const Momenta before = motion_of(sim);
    for (int s = 0; s < 80; ++s) step(sim);
    REQUIRE_FALSE(check_finite(sim, true));
    const Momenta after = motion_of(sim);
    const double scale = glm::length(before.momentum);
    CHECK(glm::length(after.momentum - before.momentum) < 1e-5 * scale);
    CHECK(glm::length(after.spin - before.spin) < 4e-3 * scale);
    CHECK(after.energy < 1.001 * before.energy);
    CHECK(speed_of(sim, 0, 0) < speed_of(sim, 1, 0));  // they have parted
    speeds.push_back(speed_of(sim, 1, 0));
    if (mode.starts_with("cpu")) continue;
    CHECK(touched(sim).touches > 0);
    CHECK(measure_overlap(*model, read_state(sim).positions, false).crossings.pairs == 0);
  }
  for (const double speed : speeds) CHECK(speed == doctest::Approx(speeds[0]).epsilon(0.05));
}

TEST_CASE("pairs: the same bits twice, nothing but boxes while bodies are far apart (long)") {
  GlTest gl;
  const auto near = blocks({{{0, 0, 0}, {1, 0, 0}}, {{0.52, 0.1, 0}, {-1, 0, 0}}, {{0.1, 0.55, 0.1}, {0, -1, 0}}});
  std::uint64_t bits = 0;
  for (const unsigned row : {0u, 0u, 3u}) {
    Tuning tuning;
    tuning.row = row;
    Sim sim = create_sim(near, touching("node"), tuning);
    for (int s = 0; s < 20; ++s) step(sim);
    if (bits == 0) bits = state_hash(sim);
    CHECK(state_hash(sim) == bits);
    CHECK(touched(sim).detections >= 5);
  }
  // More triangles near a few vertices than a queue holds.
  Placed coarse{{0.01, 0.33, 0.02}, {0, -10, 0}}, fine;
  coarse.cells = glm::ivec3(1), fine.size = {0.6, 0.1, 0.6}, fine.cells = {20, 2, 20};
  const auto dense = blocks({coarse, fine});
  for (int turn = 0; turn < 2; ++turn) {
    Sim sim = create_sim(dense, touching("node"));
    for (int s = 0; s < 3; ++s) step(sim);
    CHECK(touched(sim).touches > 0);
    if (turn == 0) bits = state_hash(sim);
    CHECK(state_hash(sim) == bits);
  }
  const auto far = blocks({{{0, 0, 0}}, {{5, 0, 0}}});
  Settings settings = touching("node");
  Sim sim = create_sim(far, settings);
  for (int s = 0; s < 20; ++s) step(sim);
  CHECK(touched(sim).detections == 0);
  CHECK(touched(sim).touches == 0);
  settings.contact = "none";
  Sim without = create_sim(far, settings);
  CHECK_FALSE(without.pairs);
  for (int s = 0; s < 20; ++s) step(without);
  CHECK(state_hash(sim) == state_hash(without));
}

TEST_CASE("pairs: how deep bodies are in each other is measured by their tets") {
  const auto model = blocks({{}, {{0.45, 0.03, 0.02}}, {{5, 0, 0}}}, false);
  const Overlap apart =
      measure_overlap(*blocks({{}, {{0.51, 0.03, 0.02}}}), blocks({{}, {{0.51, 0.03, 0.02}}})->positions, false);
  CHECK(apart.inside == 0);
  CHECK(apart.crossings.pairs == 0);
  CHECK(apart.largest == 0);
  const Overlap overlap = measure_overlap(*model, model->positions, false);
  CHECK(overlap.inside == 32);  // 4 x 4 vertices of each face
  CHECK(overlap.largest == doctest::Approx(0.05 / (0.5 * std::sqrt(3.0))));
  CHECK(overlap.part_999 <= overlap.largest);
  auto blown_up = model->positions;  // where cells cannot be counted
  blown_up[0].x = 1e12, blown_up[1].y = NAN, blown_up[130].z = -1e30;
  CHECK(measure_overlap(*model, blown_up, true).inside > 20);
  // Edges that cross where no vertex is inside.
  const double r = std::sqrt(0.5);
  Placed ridge{}, keel{{0.07, 0.7, 0.09}};
  ridge.turn = glm::dmat3(1, 0, 0, 0, r, r, 0, -r, r), keel.turn = glm::dmat3(r, r, 0, -r, r, 0, 0, 0, 1);
  const auto crossed = blocks({ridge, keel}, false);
  const Overlap cut = measure_overlap(*crossed, crossed->positions, false);
  CHECK(cut.inside == 0);
  CHECK(cut.crossings.pairs == 4);  // two beside each edge
}

TEST_CASE("pairs: a block slides on another as friction says (long)") {
  GlTest gl;
  std::vector<std::uint32_t> all(125);
  for (std::uint32_t i = 0; i < all.size(); ++i) all[i] = i;
  const double friction = 0.3, speed = 1.5;
  const auto model =
      blocks({{{0, -0.25, 0}, {}, {}, all, {3, 0.5, 1}}, {{-0.8, 0.1, 0.02}, {speed, 0, 0}, {}, {}, {0.4, 0.2, 0.4}}});
  for (const std::string mode : {"explicit", "node"}) {
    CAPTURE(mode);
    Settings settings = touching(mode, 1e6);
    settings.gravity = 9.81, settings.friction = friction;
    Sim sim = create_sim(model, settings);
    for (int s = 0; s < 20; ++s) step(sim);  // it has come to lie
    const double before = speed_of(sim, 1, 0);
    for (int s = 0; s < 40; ++s) step(sim);
    CHECK(before - speed_of(sim, 1, 0) == doctest::Approx(friction * 9.81 * 0.2).epsilon(0.02));
    CHECK(measure_overlap(*model, read_state(sim).positions, false).largest < 0.005);
  }
}

TEST_CASE("pairs: at 50 m/s and steps of 5 ms bodies do not pass through each other") {
  GlTest gl;
  const auto model = blocks({{}, {{2.01, 0.03, 0.02}, {-50, 0, 0}}});
  for (const std::string mode : {"explicit", "node"}) {
    CAPTURE(mode);
    Sim sim = create_sim(model, touching(mode, mode == "node" ? 1e6 : 1e8));
    for (int s = 0; s < 20; ++s) step(sim);
    REQUIRE_FALSE(check_finite(sim, true));
    CHECK(speed_of(sim, 0, 0) < speed_of(sim, 1, 0));
    CHECK(speed_of(sim, 0, 0) + speed_of(sim, 1, 0) == doctest::Approx(-50).epsilon(mode == "node" ? 0.02 : 1e-4));
    const State state = read_state(sim);
    CHECK(state.positions[0].x < state.positions[model->bodies[1].first_vertex].x);
  }
}

TEST_CASE("pairs: three blocks on each other come to rest (long)") {
  GlTest gl;
  std::vector<Placed> pile = {{{0, 0.25, 0}}, {{0.02, 0.75, 0.03}, {}, {0, 0.01, 0}}, {{0, 1.25, -0.02}}};
  for (Placed& block : pile) block.cells = glm::ivec3(is_long_run() ? 4 : 2);
  const auto model = blocks(pile);
  Settings settings = touching("explicit", 1e6);
  settings.gravity = 9.81, settings.ground = true, settings.friction = 0.5, settings.damping = 0.2;
  settings.constraint_damping = 3e-3;
  for (const std::string mode : {"explicit", "newton"}) {
    CAPTURE(mode);
    settings.mode = mode;
    settings.substeps = 40;  // forces alone would need fewer
    if (mode == "newton") settings.iterations = 8, settings.substeps = 2;
    Sim sim = create_sim(model, settings);
    for (int s = 0; s < (is_long_run() ? 600 : 300); ++s) step(sim);
    // J, of 375 kg: what each substep gives vertices and contact takes, which is more where these are few.
    CHECK(motion_of(sim).energy < (is_long_run() ? 0.02 : 0.1));
    CHECK(measure_overlap(*model, read_state(sim).positions, false).largest < 0.002);
    const glm::dvec3 before = centre_of(*model, read_state(sim).positions);
    for (int s = 0; s < 100; ++s) step(sim);
    CHECK(glm::distance(centre_of(*model, read_state(sim).positions), before) < (is_long_run() ? 1.5e-4 : 1e-3));
  }
}

TEST_CASE("pairs: what rests keeps the contact distance that was asked for, whatever the meshes") {
  GlTest gl;
  Settings settings = touching("explicit", 1e6);
  settings.gravity = 9.81, settings.damping = 10, settings.constraint_damping = 3e-3;
  for (const double distance : {0.005, 0.03}) {
    CAPTURE(distance);
    settings.contact_distance = distance;
    Placed below{{0, 0.25, 0}}, above{{0.02, 0.752 + distance, 0.03}};
    below.cells = glm::ivec3(3), above.cells = glm::ivec3(2);
    for (std::uint32_t v = 0; v < 4 * 4 * 4; ++v) below.fixed.push_back(v);
    const auto model = blocks({below, above});
    Sim sim = create_sim(model, settings);
    for (int s = 0; s < 120; ++s) step(sim);
    const State state = read_state(sim);
    const Body& body = model->bodies[1];
    double lowest = 1e30;
    for (std::size_t v = body.first_vertex; v < body.first_vertex + body.vertices; ++v)
      lowest = std::min(lowest, state.positions[v].y);
    CHECK(lowest - 0.5 == doctest::Approx(distance).epsilon(0.1));
  }
}

TEST_CASE("pairs: what finds no room in a list is held, counted and does not cross, until there is more") {
  GlTest gl;
  Placed below{{0, 0.25, 0}}, above{{0.02, 0.9, 0.03}, {0, -3, 0}};
  below.cells = above.cells = glm::ivec3(3);
  above.turn = glm::dmat3(glm::rotate(glm::dmat4(1), 0.3, glm::normalize(glm::dvec3(1, 2, 3))));
  for (std::uint32_t v = 0; v < 4 * 4 * 4; ++v) below.fixed.push_back(v);
  const auto model = blocks({below, above});
  Settings settings = touching("explicit", 1e6);
  settings.gravity = 9.81;
  for (Buffer Pairs::*list : {&Pairs::pairs, &Pairs::candidates, &Pairs::leaf_pairs}) {
    Sim sim = create_sim(model, settings);
    const std::size_t little = list == &Pairs::leaf_pairs ? 8 : 64, room = (sim.pairs.*list).bytes();
    const auto step_apart = [&] {
      step(sim);
      REQUIRE(find_crossings(*model, read_state(sim).positions, false).pairs == 0);
    };
    for (int s = 0; s < 40; ++s) {
      sim.pairs.*list = Buffer("little room", little);
      step_apart();
    }
    const std::uint64_t left_out = touched(sim).left_out;
    CHECK(left_out > 0);
    for (int s = 0; s < 60; ++s) step_apart();
    CHECK((sim.pairs.*list).bytes() > little);
    CHECK((sim.pairs.*list).bytes() < room);
    CHECK(touched(sim).touches > 0);
    CHECK(touched(sim).left_out < 2 * left_out);
  }
}

TEST_CASE("pairs: bodies that start in each other are moved apart, and never cross (long)") {
  GlTest gl;
  std::mt19937 random(seed_of_run(7));
  std::uniform_real_distribution<double> unit(-1, 1);
  constexpr std::array modes = {"explicit", "node"};
  double worst = 0;
  for (int round = 0; round < (is_long_run() ? 40 : 8); ++round) {
    CAPTURE(round);
    std::vector<Placed> all;
    for (int b = 0; b < 3; ++b) {
      Placed one;
      do {
        for (int c = 0; c < 3; ++c) one.at[c] = 0.4 * unit(random), one.spin[c] = 2 * unit(random);
      } while (std::ranges::any_of(all, [&](const Placed& other) { return glm::distance(other.at, one.at) < 0.35; }));
      one.cells = glm::ivec3(is_long_run() ? 4 : 2);
      all.push_back(one);
    }
    const auto model = blocks(all);
    Settings settings = touching(modes[round % 2], 1e5);
    settings.constraint_damping = 3e-3;
    if (round % 4 >= 2) settings.contact = "self";
    Sim sim = create_sim(model, settings);
    for (int s = 0; s < (is_long_run() ? 200 : 100); ++s) step(sim);
    REQUIRE_FALSE(check_finite(sim, true));
    const double overlap = measure_overlap(*model, read_state(sim).positions, false).largest;
    CHECK(overlap < 0.01);
    worst = std::max(worst, overlap);
  }
  record_worst("bodies that start in each other: overlap over size", worst, 0.01);
}

TEST_CASE("pairs: after a state that is not finite, the last good one goes on as it did, in every mode (long)") {
  GlTest gl;
  Placed left{{0, 0, 0}, {0.7, 0, 0}}, right{{0.71, 0.02, 0.03}};  // they meet in step 60
  if (!is_long_run()) left.cells = right.cells = glm::ivec3(2);
  const auto model = blocks({left, right});
  for (const char* mode : {"node", "constraint", "explicit", "newton"}) {
    CAPTURE(mode);
    Settings settings = touching(mode);
    if (!is_long_run() && settings.substeps != automatic) settings.substeps = 5;
    Sim sim = create_sim(model, settings);
    std::uint64_t good = 0;
    for (int s = 0; s < 100; ++s) {
      step(sim);
      if (sim.steps == 90) good = state_hash(sim);
    }
    REQUIRE(touched(sim).touches > 0);
    const Velocity nowhere{glm::vec3(NAN), 0, glm::vec3(0), 0};
    sim.velocities.write(0, sizeof nowhere, &nowhere);
    for (int s = 0; s < 6; ++s) step(sim);
    REQUIRE(check_finite(sim, true));
    REQUIRE(restore_checkpoint(sim));
    REQUIRE(sim.steps == 64);
    while (sim.steps < 90) step(sim);
    CHECK(state_hash(sim) == good);
  }
}

TEST_CASE("pairs: thin plates above each other do not touch") {
  GlTest gl;
  Placed upper, lower;
  upper.size = lower.size = {1, 0.02, 1}, upper.cells = lower.cells = {5, 1, 5};
  for (const double apart : {0.06, 0.1, 0.14}) {  // 0.02 m thick, with offsets of 0.03 m
    CAPTURE(apart);
    lower.at.y = -apart;
    Sim sim = create_sim(blocks({upper, lower}), touching("explicit"));
    for (int s = 0; s < 3; ++s) step(sim);
    CHECK(touched(sim).detections > 0);
    CHECK(touched(sim).touches == 0);
  }
}

TEST_CASE("pairs: eight balls or cubes fall into a bowl in ten ways: all end finite and out of each other (long)") {
  GlTest gl;
  std::mt19937 random(seed_of_run(5));
  std::uniform_real_distribution<double> unit(-1, 1);
  double worst = 0;
  for (int start = 0; start < (is_long_run() ? 20 : 4); ++start) {
    CAPTURE(start);
    const bool balls = start % 2 == 0;
    std::vector<Placed> all;
    for (int b = 0; b < 8; ++b) {
      Placed one;
      one.size = glm::dvec3(0.3), one.cells = glm::ivec3(balls ? 4 : 2), one.round = balls;
      one.at = {0.2 * (b % 2 ? 1 : -1), 0.3 + 0.4 * double(b / 4), 0.2 * (b / 2 % 2 ? 1 : -1)};
      for (int c = 0; c < 3; ++c) one.at[c] += 0.03 * unit(random), one.spin[c] = 3 * unit(random);
      all.push_back(one);
    }
    Model model = *blocks(all);
    for (int side = 0; side < 4; ++side) {  // a funnel without a hole
      const double angle = glm::half_pi<double>() * side;
      model.obstacles.push_back(
          samples::half_space(glm::normalize(glm::dvec3(std::cos(angle), 1.5, std::sin(angle))), -0.25));
    }
    Settings settings = touching("explicit", 5e4);
    settings.gravity = 9.81, settings.damping = 1, settings.friction = 0.3;
    const auto shared = std::make_shared<const Model>(model);
    Sim sim = create_sim(shared, settings);
    for (int s = 0; s < 120; ++s) step(sim);
    REQUIRE_FALSE(check_finite(sim, true));
    CHECK(touched(sim).touches > 100);
    const double overlap = measure_overlap(*shared, read_state(sim).positions, false).largest;
    CHECK(overlap < 0.02);
    worst = std::max(worst, overlap);
  }
  record_worst("bodies in a bowl: overlap over size", worst, 0.02);
}

TEST_CASE("pairs: modes without contact between bodies refuse it, and so do references that cannot") {
  Settings hard;
  hard.mode = "paper", hard.contact = "bodies";
  CHECK_THROWS_WITH(check_settings(hard, "here"), doctest::Contains("do not touch each other"));
  const auto model = blocks({{{0, 0, 0}}, {{0.6, 0, 0}}});
  hard.mode = "node";
  CHECK_THROWS_WITH(find_motion({*model, {}, hard, model->inverse_masses}, 2),
                    doctest::Contains("no reference motion of bodies that touch"));
}

TEST_CASE("pairs: explicit, newton and PBD are held against a reference in which bodies touch (long)") {
  GlTest gl;
  const auto model = blocks({{{-0.3, 0, 0}, {1, 0, 0}}, {{0.3, 0.06, 0.04}, {-1, 0, 0}}});
  Settings settings = touching("explicit", 1e5);
  const long steps = 40;
  settings.iterations = 8, settings.substeps = 5;
  const ConstraintSystem system = build_constraints(model->rest, settings);
  const Motion right = find_motion({*model, system, settings, model->inverse_masses}, steps);
  CHECK(right.method == "leapfrog");
  // It is not that of bodies that pass through each other.
  settings.contact = "none";
  const Motion through = find_motion({*model, system, settings, model->inverse_masses}, steps);
  CHECK(right.scene != through.scene);
  CHECK(error_to(*model, {right.positions.back(), {}}, {through.positions.back(), {}}) > 0.1);
  settings.contact = "bodies";
  for (const auto& [mode, most] : {std::pair("explicit", 0.002), {"newton", 0.025}, {"node", 0.01}, {"cpu", 0.01}}) {
    CAPTURE(mode);
    settings.mode = mode;
    Sim sim = create_sim(model, settings);
    for (int s = 0; s < steps; ++s) step(sim);
    CHECK(error_to(*model, {right.positions.back(), {}}, read_state(sim)) < most);
  }
}

TEST_CASE("pairs: a run says how deep bodies came to be in each other, where they touch") {
  GlTest gl;
  const auto model = blocks({{{-0.3, 0, 0}, {1, 0, 0}}, {{0.3, 0.06, 0.04}, {-1, 0, 0}}});
  for (const std::string mode : {"explicit", "cpu-fast"}) {
    Settings settings = touching(mode, 1e5);
    const Overlap met = run_model(model, settings, 40).errors.overlap.value();
    CHECK(met.inside == 0);
    CHECK(met.crossings.pairs == 0);
    CHECK(met.largest < 1e-5);
    CHECK(met.part_999 <= met.largest);
    settings.contact = "none";
    CHECK(!run_model(model, settings, 40).errors.overlap);  // it is not asked
  }
}

TEST_CASE("pairs: buffers of contact are no larger than the driver allows") {
  GlTest gl;
  Placed left{{-0.24, 0, 0}}, right{{0.24, 0, 0}};
  left.cells = right.cells = glm::ivec3(1);  // all surface
  const auto model = blocks({left, right});
  const Sim sim = create_sim(model, touching("explicit"));
  for (const Buffer& other : sim.solver.buffers) REQUIRE(other.bytes() < sim.pairs.pairs.bytes());
  CHECK_THROWS_WITH_AS(create_sim(model, touching("explicit"), {.storage = sim.pairs.pairs.bytes() - 1}),
                       doctest::Contains("'pairs of surfaces' of"), Error);
}

TEST_CASE("pairs: contacts are drawn as arrows along the triangles' normals") {
  GlTest gl;
  const auto model = blocks({{{-0.26, 0, 0}, {1, 0, 0}}, {{0.26, 0, 0}, {-1, 0, 0}}});
  Sim sim = create_sim(model, touching("explicit"));
  for (int s = 0; s < 4; ++s) step(sim);
  REQUIRE(touched(sim).touches > 0);
  Renderer renderer = make_renderer(*model);
  const Target target = make_target(320, 240);
  Camera camera;
  camera.distance = 3;
  const auto picture = [&](bool contacts) {
    Frame frame = make_frame(sim, camera, {.contacts = contacts}, target);
    frame.target = target.framebuffer.id();
    draw(renderer, frame);
    return read_rgba(target);
  };
  const Image without = picture(false), with = picture(true);
  long red = 0;
  for (std::size_t p = 0; p + 3 < with.rgba.size(); p += 4)
    red += with.rgba[p] > without.rgba[p] + 20 && with.rgba[p + 1] + 20 < without.rgba[p + 1];
  CHECK(red > 100);
  // Vertices on an obstacle are known as well.
  Model other = *blocks({{{0, 0, 0}}});
  Obstacle ball;
  ball.kind = find_obstacle_kind("sphere"), ball.radius = 0.25, ball.centre = {0, -0.5, 0};
  other.obstacles.push_back(ball);
  Settings settings = touching("explicit");
  settings.gravity = 9.81;
  Sim on_ball = create_sim(std::make_shared<const Model>(other), settings);
  Frame frame = make_frame(on_ball, camera, {.contacts = true}, target);
  for (int s = 0; s < 5; ++s) step(on_ball);
  update(frame, on_ball);
  CHECK(frame.touching.size() >= 1);
  CHECK(frame.touching.size() < 40);
  CHECK(gl_error_count() == 0);
}
