// Mode newton: blocks of its matrix against finite differences, its second level against algebra, its steps
// against leapfrog in double.
#include <doctest/doctest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <thread>

#include "sim/error.h"
#include "sim/hash.h"
#include "sim/model/material.h"
#include "sim/reference/leapfrog.h"
#include "sim/reference/motion.h"
#include "sim/sim.h"
#include "sim/solvers/aggregates.h"
#include "tests/gl_test.h"
#include "tests/long_run.h"
#include "tests/reference/reference_scenes.h"

using namespace tetpbd;
using reference_scenes::centre_of, reference_scenes::irregular_block, reference_scenes::noise;

namespace {

struct Tet4 {
  std::array<glm::dvec3, 4> x;
  std::array<double, 8> rest;
  std::array<double, 2> compliance;
};

// At rest irregular; then moved by `strain` times its size at random.
Tet4 tet_of(double strain, double nu) {
  Tet4 tet;
  tet.x = {glm::dvec3(0), {1, 0.1, 0}, {0.2, 0.9, 0.1}, {0.1, 0.3, 1.1}};
  for (auto& p : tet.x) p += noise(0.1);
  const double six = glm::dot(glm::cross(tet.x[1] - tet.x[0], tet.x[2] - tet.x[0]), tet.x[3] - tet.x[0]);
  const auto [mu, lambda] = lame(1e6, nu);
  const double ours = 4.0 / 3 * mu, bulk = lambda + 5.0 / 6 * mu;
  tet.rest = NeoHookean::rest(tet.x.data());
  tet.rest[7] = 1 + 0.75 * ours / bulk;
  tet.compliance = {6 / (ours * six), 6 / (bulk * six)};
  for (auto& p : tet.x) p += noise(strain);
  return tet;
}

// dE/dx of E = sum C^2 / (2 compliance).
std::array<glm::dvec3, 4> forces(Tet4 tet) {
  const auto c = NeoHookean::evaluate<double>(tet.x.data(), tet.rest.data());
  std::array<glm::dvec3, 4> sum;
  for (int j = 0; j < 4; ++j)
    sum[std::size_t(j)] = c.C[0] / tet.compliance[0] * c.gradient[0][j] + c.C[1] / tet.compliance[1] * c.gradient[1][j];
  return sum;
}

auto part_of(Tet4 tet, int i, int j) {
  return Formulas<double>{}.neo_hookean_part(tet.x.data(), tet.rest.data(), tet.compliance.data(), i, j);
}

Settings soft(const std::string& material, double tau = 0) {
  Settings settings;
  settings.mode = "newton", settings.material = material, settings.constraint_damping = tau;
  settings.young_modulus = 1e5, settings.iterations = 30, settings.substeps = 1;
  if (material == "smoothed") settings.material = "neo-hookean", settings.element = "smoothed";
  if (material == "none") {
    settings.compliance[index_of<Stretch>] = 1e-4, settings.compliance[index_of<Volume>] = 5e-9;
    settings.compliance[index_of<Bend>] = 1;
  }
  return settings;
}

double distance(const std::vector<glm::dvec3>& a, const std::vector<glm::dvec3>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += glm::dot(a[i] - b[i], a[i] - b[i]);
  return std::sqrt(sum / double(a.size()));
}

std::shared_ptr<const Model> deformed(const char* how) {
  TetMesh mesh = make_block({0.8, 1, 0.6}, {4, 5, 3});
  finish_tets(mesh, "block");
  auto start = mesh.positions;
  for (auto& p : start) p.y += 2;
  deform(start, mesh, how, 1);
  auto model = std::make_shared<Model>();
  add_body(*model, "block", mesh, 1000, start, {}, {}, {});
  return model;
}

// And angular momentum about it.
std::pair<glm::dvec3, glm::dvec3> centre_and_spin(const Model& model, const State& state) {
  const glm::dvec3 centre = centre_of(model, state.positions), velocity = centre_of(model, state.velocities);
  glm::dvec3 spin(0);
  for (std::size_t i = 0; i < model.masses.size(); ++i)
    spin += model.masses[i] * glm::cross(state.positions[i] - centre, state.velocities[i] - velocity);
  return {centre, spin};
}

double kinetic_energy(const Model& model, const State& state) {
  double sum = 0;
  for (std::size_t i = 0; i < model.masses.size(); ++i)
    sum += 0.5 * model.masses[i] * glm::dot(state.velocities[i], state.velocities[i]);
  return sum;
}

Grouped neighbours_of(const TetMesh& mesh) {
  const auto edges = tet_edges(mesh);
  return group_by_key(edges.size(), mesh.positions.size(), [&](std::size_t e, auto&& emit) {
    emit(edges[e][0], edges[e][1]), emit(edges[e][1], edges[e][0]);
  });
}

}  // namespace

TEST_CASE("newton: blocks of a neo-Hookean tet are its forces' derivatives, wherever nothing is left out") {
  reference_scenes::generator.seed(5);
  int exact = 0;
  for (int trial = 0; trial < 60; ++trial) {
    Tet4 tet = tet_of(0.05, trial % 2 ? 0.3 : 0.45);
    // The part of J is taken whole where the tet is stretched little or compressed less than at rest.
    for (auto& p : tet.x) p *= 1.03;
    const auto here = forces(tet);
    double largest = 0, off = 0;
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < 4; ++j) {
        if (i == j) continue;
        glm::dmat3 block;
        for (int a = 0; a < 3; ++a) {
          Tet4 low = tet, high = tet;
          low.x[std::size_t(j)][a] -= 1e-6, high.x[std::size_t(j)][a] += 1e-6;
          block[a] = (forces(high)[std::size_t(i)] - forces(low)[std::size_t(i)]) / 2e-6;
        }
        const auto part = part_of(tet, i, j);
        for (int a = 0; a < 3; ++a)
          largest = std::max(largest, glm::length(block[a])),
          off = std::max(off, glm::length(block[a] - part.block[a]));
        const auto back = part_of(tet, j, i);
        CHECK(glm::length(part.force + back.force) <= 1e-9 * (1 + glm::length(part.force)));
      }
    if (off < 1e-6 * largest) ++exact;
    for (int i = 0; i < 4; ++i) {
      glm::dvec3 sum(0);
      for (int j = 0; j < 4; ++j)
        if (i != j) sum += part_of(tet, i, j).force;
      CHECK(glm::length(sum - here[std::size_t(i)]) <= 1e-9 * (1 + glm::length(sum)));
    }
  }
  CHECK(exact >= 20);
}

TEST_CASE("newton: a neo-Hookean tet's matrix has no negative direction, however it is bent") {
  reference_scenes::generator.seed(6);
  for (const double strain : {0.0, 0.3, 1.0, 3.0})
    for (int trial = 0; trial < 50; ++trial) {
      const Tet4 tet = tet_of(strain, trial % 2 ? 0.3 : 0.49);
      Eigen::Matrix<double, 12, 12> whole = Eigen::Matrix<double, 12, 12>::Zero();
      for (int i = 0; i < 4; ++i)
        for (int j = 0; j < 4; ++j) {
          if (i == j) continue;
          const auto part = part_of(tet, i, j);
          const Eigen::Map<const Eigen::Matrix3d> block(&part.block[0].x);
          whole.block<3, 3>(3 * i, 3 * j) = block, whole.block<3, 3>(3 * i, 3 * i) -= block;
        }
      CHECK((whole - whole.transpose()).norm() <= 1e-9 * whole.norm());
      const Eigen::VectorXd values = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(whole).eigenvalues();
      CHECK(values.minCoeff() >= -1e-6 * values.maxCoeff());
      if (strain == 0) CHECK(values(6) > 1e-4 * values(11));  // six ways to move freely, no more
    }
}

TEST_CASE("newton: aggregates share all that moves, and nothing across a gap") {
  // Two slabs a hundredth apart, and one vertex held.
  auto model = std::make_shared<Model>();
  for (const double y : {0.0, 0.11}) {
    TetMesh mesh = make_block({1, 0.1, 0.5}, {20, 2, 10});
    for (auto& p : mesh.positions) p.y += y;
    finish_tets(mesh, "slab");
    add_body(*model, "slab", mesh, 1000, mesh.positions, {}, {}, {7});
  }
  const Aggregates aggregates = make_aggregates(*model, neighbours_of(model->rest), {6, 8});
  CHECK(aggregates.first == std::vector<std::uint32_t>{0, 6, 14});
  std::vector<int> slab(aggregates.all.size(), -1);
  for (std::size_t v = 0; v < model->positions.size(); ++v) {
    std::uint32_t sum = 0;
    const int which = v >= model->bodies[1].first_vertex;
    for (const Share& share : aggregates.of_vertex[v]) {
      sum += share.weight;
      if (share.weight == 0) continue;
      if (slab[share.aggregate] < 0) slab[share.aggregate] = which;
      CHECK(slab[share.aggregate] == which);
    }
    CHECK(sum == (model->inverse_masses[v] > 0 ? 65535 : 0));
  }
}

TEST_CASE(
    "newton: aggregates of a large body are kept, and made again where the file is damaged or the body "
    "another") {
  const std::filesystem::path folder = std::filesystem::temp_directory_path() / "tetpbd_test_aggregates";
  std::filesystem::remove_all(folder), std::filesystem::create_directories(folder);
  const char* before = std::getenv("TETPBD_CACHE");
  const std::string kept = before ? before : "";
  setenv("TETPBD_CACHE", folder.c_str(), 1);
  TetMesh mesh = make_block({1, 1, 1}, {22, 22, 22});
  finish_tets(mesh, "block");
  Model model;
  add_body(model, "block", mesh, 1000, mesh.positions, {}, {}, {});
  const Grouped neighbours = neighbours_of(model.rest);
  const auto made = [&](std::size_t wanted) { return make_aggregates(model, neighbours, {wanted}); };
  const auto same = [](const Aggregates& a, const Aggregates& b) {
    const auto bits = [](const Aggregates& c) {
      return hash_values(c.members.values, hash_values(c.of_vertex, hash_values(c.all)));
    };
    return bits(a) == bits(b);
  };
  const auto files = [&] {
    std::vector<std::filesystem::path> all;
    for (const auto& entry : std::filesystem::directory_iterator(folder)) all.push_back(entry.path());
    return all;
  };
  const Aggregates first = made(40);
  REQUIRE(files().size() == 1);
  const auto written = std::filesystem::last_write_time(files()[0]);
  CHECK(same(made(40), first));
  CHECK(std::filesystem::last_write_time(files()[0]) == written);
  std::filesystem::resize_file(files()[0], std::filesystem::file_size(files()[0]) - 40);
  CHECK(same(made(40), first));
  CHECK(std::filesystem::last_write_time(files()[0]) > written);
  CHECK_FALSE(same(made(50), first));
  CHECK(files().size() == 2);
  before ? setenv("TETPBD_CACHE", kept.c_str(), 1) : unsetenv("TETPBD_CACHE");
}

TEST_CASE("newton: an aggregate of one vertex, whose neighbours are all fixed, has no rotation by rounding") {
  for (std::uint32_t lone = 0; lone < 120; ++lone) {
    Model model = *irregular_block(1, false);
    const Grouped neighbours = neighbours_of(model.rest);
    for (std::uint32_t k = neighbours.first[lone]; k < neighbours.first[lone + 1]; ++k)
      model.inverse_masses[neighbours.values[k]] = 0;
    const Aggregates aggregates = make_aggregates(model, neighbours, {4});
    std::size_t alone = 0;
    for (std::size_t a = 0; a < aggregates.all.size(); ++a) {
      CHECK(aggregates.all[a].reach > 1e-3 * model.size);
      alone += aggregates.members.first[a + 1] - aggregates.members.first[a] == 1;
    }
    CHECK(alone >= 1);
  }
}

TEST_CASE("newton: the coarse matrix is the fine one between rigid motions, inverted") {
  const auto model = irregular_block(1, true, {}, {});
  const Grouped neighbours = neighbours_of(model->rest);
  const Aggregates aggregates = make_aggregates(*model, neighbours, {4});
  const std::size_t n = model->positions.size();
  std::vector<double> inertia;
  for (const double w : model->inverse_masses) inertia.push_back(w > 0 ? 1e5 / w : 0);
  // Springs between neighbours.
  std::vector<glm::dmat3> blocks;
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(Eigen::Index(3 * n), Eigen::Index(3 * n));
  for (std::size_t v = 0; v < n; ++v) {
    A.block<3, 3>(Eigen::Index(3 * v), Eigen::Index(3 * v)) += inertia[v] * Eigen::Matrix3d::Identity();
    for (std::uint32_t k = neighbours.first[v]; k < neighbours.first[v + 1]; ++k) {
      const std::uint32_t u = neighbours.values[k];
      const glm::dvec3 along = glm::normalize(model->rest.positions[u] - model->rest.positions[v]);
      blocks.push_back(-1e4 * glm::outerProduct(along, along));
      const Eigen::Map<const Eigen::Matrix3d> block(&blocks.back()[0].x);
      A.block<3, 3>(Eigen::Index(3 * v), Eigen::Index(3 * u)) += block;
      A.block<3, 3>(Eigen::Index(3 * v), Eigen::Index(3 * v)) -= block;
    }
  }
  const std::size_t unknowns = 6 * aggregates.all.size(), width = (unknowns + 3) / 4 * 4;
  Eigen::MatrixXd Q = Eigen::MatrixXd::Zero(Eigen::Index(3 * n), Eigen::Index(unknowns));
  for (std::size_t v = 0; v < n; ++v)
    for (const Share& share : aggregates.of_vertex[v])
      for (int mode = 0; mode < 6 && share.weight > 0; ++mode) {
        glm::dvec3 axis(0);
        axis[mode % 3] = 1;
        const Aggregate& a = aggregates.all[share.aggregate];
        const glm::dvec3 way = mode < 3 ? axis : glm::cross(axis, (model->rest.positions[v] - a.centre) / a.reach);
        for (int c = 0; c < 3; ++c)
          Q(Eigen::Index(3 * v) + c, Eigen::Index(6 * share.aggregate) + mode) += way[c] * share.weight / 65535.0;
      }
  const Eigen::MatrixXd coarse = Q.transpose() * A * Q;
  const std::vector<float> inverse = coarse_inverse(*model, 0, aggregates, {neighbours, inertia, blocks}, nullptr);
  REQUIRE(inverse.size() == unknowns * width);
  Eigen::MatrixXd found{Eigen::Index(unknowns), Eigen::Index(unknowns)};
  for (std::size_t r = 0; r < unknowns; ++r)
    for (std::size_t c = 0; c < unknowns; ++c) found(Eigen::Index(r), Eigen::Index(c)) = inverse[r * width + c];
  CHECK((found * coarse - Eigen::MatrixXd::Identity(Eigen::Index(unknowns), Eigen::Index(unknowns))).norm() < 1e-2);
}

TEST_CASE("newton: its motion nears that of leapfrog with the square of the step, damped or not (long)") {
  GlTest gl;
  for (const auto& [material, tau] :
       {std::pair{"none", 2e-3}, {"springs", 0.0}, {"neo-hookean", 2e-3}, {"smoothed", 0.0}}) {
    CAPTURE(material);
    const auto model = irregular_block(1, true, {0.3, 0, 0}, {0, 0, 1});
    Settings settings = soft(material, tau);
    settings.damping = 0.3, settings.iterations = 15;
    std::vector<double> off;
    for (const int substeps : {2, 4, 8}) {
      settings.substeps = substeps;
      Sim sim = create_sim(model, settings);
      const ReferenceInput input{*model, sim.system, sim.settings, sim.inverse_masses};
      Leapfrog right = leapfrog(input, reference_compliances(input), {model->positions, model->velocities}, 2e-4);
      for (int s = 0; s < 20; ++s) step(sim), advance(right, 25);
      off.push_back(distance(read_state(sim).positions, right.x));
    }
    const double moved = 0.5 * 9.81 * 0.1 * 0.1;
    CHECK(off[0] < 0.03 * moved);
    CHECK(off[1] < 0.45 * off[0]);
    CHECK(off[2] < 0.45 * off[1]);
  }
}

TEST_CASE("newton: what falls freely falls as it should, spinning, in few iterations") {
  GlTest gl;
  const auto model = irregular_block(30, false, {1, 0, 2}, {3, -2, 4});
  for (const char* material : {"neo-hookean", "smoothed"}) {
    CAPTURE(material);
    Settings settings = soft(material);
    settings.iterations = 4;
    Sim sim = create_sim(model, settings);
    const auto [centre, spin] = centre_and_spin(*model, {model->positions, model->velocities});
    for (int s = 0; s < 80; ++s) step(sim);
    const auto [now, left] = centre_and_spin(*model, read_state(sim));
    CHECK(glm::length(now - (centre + glm::dvec3(0.4, -0.5 * 9.81 * 0.16, 0.8))) < 1e-3);
    CHECK(glm::length(left - spin) < 0.03 * glm::length(spin));
  }
}

TEST_CASE("newton: a stiff block that spins fast keeps its spin in more substeps, and gains no energy") {
  GlTest gl;
  auto model = std::make_shared<Model>(*deformed("none"));
  const glm::dvec3 centre = centre_of(*model, model->positions);
  for (std::size_t i = 0; i < model->positions.size(); ++i)
    model->velocities[i] = glm::cross(glm::dvec3(30, 80, 52), model->positions[i] - centre);
  const State start{model->positions, model->velocities};
  Settings settings = soft("neo-hookean");
  settings.young_modulus = 1e8, settings.iterations = 4, settings.substeps = 2, settings.gravity = 0;
  settings.ground = false;
  Sim sim = create_sim(model, settings);
  for (int s = 0; s < 60; ++s) step(sim);
  CHECK(sim.adaptive.substep_factor == 4);
  CHECK(adaptive_values(sim).least_health == float(HEALTH_TURNING));
  const State now = read_state(sim);
  CHECK(kinetic_energy(*model, now) < 1.01 * kinetic_energy(*model, start));
  // Without, 0.15 of it is gone, and later energy comes from nowhere.
  const glm::dvec3 spin = centre_and_spin(*model, start).second;
  CHECK(glm::length(centre_and_spin(*model, now).second - spin) < 0.02 * glm::length(spin));
}

TEST_CASE("newton: a soft block lands, stays out of the ground, gains no energy and comes to rest") {
  GlTest gl;
  const auto model = irregular_block(0.2, false, {}, {});
  Settings settings = soft("neo-hookean", 2e-3);
  settings.iterations = 8, settings.substeps = 2, settings.damping = 4;
  Sim sim = create_sim(model, settings);
  double lowest = 0, fastest = 0;
  const double start = 0.6 * 9.81;  // of the centre, at most
  for (int s = 0; s < 400; ++s) {
    step(sim);
    const State state = read_state(sim);
    double kinetic = 0, mass = 0;
    for (std::size_t i = 0; i < state.positions.size(); ++i) {
      lowest = std::min(lowest, state.positions[i].y);
      kinetic += 0.5 * model->masses[i] * glm::dot(state.velocities[i], state.velocities[i]);
      mass += model->masses[i];
    }
    CHECK(kinetic / mass < start);
    fastest = std::sqrt(2 * kinetic / mass);
  }
  CHECK(lowest > -1e-4);
  CHECK(fastest < 0.005);
}

TEST_CASE("newton: a block that slides stops where friction stops it") {
  GlTest gl;
  const auto mesh = [] {
    TetMesh block = make_block({0.6, 0.2, 0.4}, {6, 2, 4});
    for (auto& p : block.positions) p.y += 0.1;
    finish_tets(block, "block");
    return block;
  }();
  auto model = std::make_shared<Model>();
  add_body(*model, "block", mesh, 1000, mesh.positions, {1.5, 0, 0}, {}, {});
  Settings settings = soft("neo-hookean", 2e-3);
  settings.young_modulus = 1e6, settings.iterations = 8, settings.substeps = 2, settings.friction = 0.5;
  Sim sim = create_sim(model, settings);
  for (int s = 0; s < 120; ++s) step(sim);
  const State state = read_state(sim);
  double way = 0;
  for (std::size_t i = 0; i < state.positions.size(); ++i) way += state.positions[i].x - model->positions[i].x;
  way /= double(state.positions.size());
  CHECK(way == doctest::Approx(1.5 * 1.5 / (2 * 0.5 * 9.81)).epsilon(0.07));
}

namespace {

int inverted_tets(const Sim& sim) {
  const auto x = read_state(sim).positions;
  int inverted = 0;
  for (const Tet& t : sim.model->rest.tets)
    inverted += glm::dot(glm::cross(x[t[1]] - x[t[0]], x[t[2]] - x[t[0]]), x[t[3]] - x[t[0]]) <= 0;
  return inverted;
}

}  // namespace

TEST_CASE("newton: hostile starts end whole (long)") {
  GlTest gl;
  for (const char* material : {"neo-hookean", "smoothed"})
    for (const std::string how : {"squash:0.1", "mirror", "random", "invert-one", "stretch:4", "flatten"}) {
      const bool smoothed = material == std::string("smoothed");
      if (!is_long_run() && (smoothed || how == "squash:0.1" || how == "invert-one" || how == "stretch:4")) continue;
      CAPTURE(material);
      CAPTURE(how);
      Settings settings = soft(material, 2e-3);
      settings.young_modulus = 1e6, settings.poisson_ratio = 0.45, settings.iterations = 8;
      Sim sim = create_sim(deformed(how.c_str()), settings);
      for (int s = 0; s < 200; ++s) step(sim);
      CHECK_FALSE(check_finite(sim, true));
      CHECK(inverted_tets(sim) <= (smoothed ? 1 : 0));  // of 360
    }
}

TEST_CASE("newton: three iterations keep the momentum and the energy of stiff free bodies") {
  GlTest gl;
  // One is summed by many work-groups and one by one; a third is held.
  auto model = std::make_shared<Model>();
  for (const int body : {0, 1, 2}) {
    const int finer = body == 0 ? 4 : 1;
    TetMesh mesh = make_block({0.8, 1, 0.6}, glm::ivec3(4, 5, 3) * finer);
    finish_tets(mesh, "block");
    auto start = mesh.positions;
    for (auto& p : start) p += glm::dvec3(3 * body, 2, 0);
    add_body(*model, "block", mesh, 1000, start, {1, 0, 0.5 * body}, {6, -8, 2.0 * body},
             body == 2 ? std::vector<std::uint32_t>{0} : std::vector<std::uint32_t>{});
  }
  Settings stiff = soft("neo-hookean");
  stiff.young_modulus = 1e9, stiff.poisson_ratio = 0.45, stiff.iterations = 3, stiff.gravity = 0;
  Sim sim = create_sim(model, stiff);
  const auto of_body = [&](const Body& body) {
    State all = read_state(sim), part;
    Model own;
    for (std::size_t i = body.first_vertex; i < body.first_vertex + body.vertices; ++i) {
      part.positions.push_back(all.positions[i]), part.velocities.push_back(all.velocities[i]);
      own.masses.push_back(model->masses[i]);
    }
    return std::pair(centre_and_spin(own, part).second, kinetic_energy(own, part));
  };
  std::vector<std::pair<glm::dvec3, double>> before;
  for (const Body& body : model->bodies) before.push_back(of_body(body));
  for (int s = 0; s < 40; ++s) step(sim);
  for (const std::size_t body : {0u, 1u}) {
    CAPTURE(body);
    const auto [spin, energy] = of_body(model->bodies[body]);
    CHECK(glm::length(spin - before[body].first) < 0.02 * glm::length(before[body].first));
    CHECK(energy == doctest::Approx(before[body].second).epsilon(0.03));
  }
  CHECK(glm::length(of_body(model->bodies[2]).first - before[2].first) > 0.1 * glm::length(before[2].first));
}

TEST_CASE("newton: takes shorter substeps while a step goes badly, and then no tet is inverted (long)") {
  GlTest gl;
  Settings stiff = soft("neo-hookean");
  stiff.young_modulus = 1e8, stiff.poisson_ratio = 0.495, stiff.iterations = 8;
  for (const std::string how : {"none", "invert-one"}) {  // both fall on the ground
    CAPTURE(how);
    std::uint64_t bits = 0;
    for (const int run : {0, 1, 2}) {
      CAPTURE(run);
      Sim sim = create_sim(deformed(how.c_str()), stiff);
      if (run == 0) sim.adaptive.readback = {};  // not watched
      int steps_with_inverted = 0;
      for (int s = 0; s < 250; ++s) {
        step(sim);
        steps_with_inverted += inverted_tets(sim) > 0;
      }
      CHECK(steps_with_inverted == 0);
      const auto settled = [&] { return sim.adaptive.substep_factor == 1 || sim.adaptive.health < LEAST_HEALTH; };
      for (int s = 0; s < 40 && !settled(); ++s) step(sim);
      CHECK(settled());
      if (run == 0) continue;
      CHECK(sim.adaptive.most_substeps == 4);
      CHECK(adaptive_values(sim).least_health < 0.1);
      if (run == 1) bits = state_hash(sim);
      CHECK(state_hash(sim) == bits);
      reset(sim);
      CHECK(sim.adaptive.most_substeps == 0);
    }
  }
  Settings healthy = soft("neo-hookean");
  healthy.iterations = 8;
  Sim sim = create_sim(deformed("none"), healthy);
  for (int s = 0; s < 200; ++s) step(sim);
  CHECK(sim.adaptive.most_substeps == 1);
}

TEST_CASE("newton: a body that is pulled comes to where it rests in mode explicit, and lets go (long)") {
  GlTest gl;
  const auto model = deformed("none");
  const std::uint32_t held = 0, pulled = std::uint32_t(model->positions.size()) - 1;
  std::vector<std::vector<glm::dvec3>> ends;
  for (const char* mode : {"newton", "explicit"}) {
    Settings settings = soft("neo-hookean");
    settings.mode = mode, settings.iterations = 8, settings.gravity = 0, settings.damping = 8;
    Sim sim = create_sim(model, settings);
    pin(sim, held), pin(sim, pulled);
    const glm::dvec3 from = model->positions[pulled], way(0.1, 0.2, 0.05);
    for (int s = 1; s <= 40; ++s) move_pinned(sim, pulled, from + way * (s / 40.0)), step(sim);
    for (int s = 0; s < 400; ++s) step(sim);
    CHECK_FALSE(check_finite(sim, true));
    ends.push_back(read_state(sim).positions);
    CHECK(glm::distance(ends.back()[pulled], from + way) < 1e-6);
    unpin(sim, pulled);
    for (int s = 0; s < 40; ++s) step(sim);
    CHECK(glm::distance(read_state(sim).positions[pulled], from + way) > 0.01);
    CHECK(sim.adaptive.substep_factor == 1);
  }
  CHECK(distance(ends[0], ends[1]) < 2e-4);
  CHECK(distance(ends[0], model->positions) > 0.02);
}

TEST_CASE("newton: with other steps or forces while running it is soon as if made for them (long)") {
  GlTest gl;
  std::string material = "neo-hookean";
  SUBCASE("linear") {}
  SUBCASE("smoothed") { material = "smoothed"; }
  Settings settings = soft(material, 1e-3);
  settings.iterations = 6;
  Sim sim = create_sim(deformed("stretch:1.2"), settings), late = create_sim(sim.model, settings);
  for (int s = 0; s < 8; ++s) step(sim), step(late);
  const auto second_level = [](const Sim& of) {
    const auto found = std::ranges::find(of.solver.buffers, "coarse matrix", &Buffer::label);
    return found->read_all<float>();
  };
  const auto change = [&](double& value, double to) {
    value = to;
    for (Sim* each : {&sim, &late}) apply_settings(*each, settings);
  };
  for (const auto& [value, to] : {std::pair(&settings.dt, 0.01),
                                  {&settings.young_modulus, 1e6},
                                  {&settings.poisson_ratio, 0.45},
                                  {&settings.constraint_damping, 3e-3}}) {
    CAPTURE(to);
    const auto served = second_level(sim);
    const GLuint vectors = sim.solver.buffers[0].id();
    change(*value, to);
    CHECK(sim.solver.buffers[0].id() == vectors);  // the solver is not made again
    for (int s = 0; s < 7; ++s) step(sim), step(late), std::this_thread::sleep_for(std::chrono::milliseconds(5));
    CHECK(second_level(sim) == served);
    step(sim), step(late);
    CHECK(second_level(sim) != served);
    CHECK(state_hash(sim) == state_hash(late));
    Sim fresh = create_sim(sim.model, settings);
    CHECK(second_level(sim) == second_level(fresh));
    const State state = read_state(sim);
    write_state(sim, state), write_state(fresh, state), write_state(late, state);
    for (int s = 0; s < 4; ++s) step(sim), step(fresh), step(late);
    CHECK(state_hash(sim) == state_hash(fresh));
    CHECK(distance(read_state(sim).positions, state.positions) > 1e-4);
  }
  // Another change before the first one's is there: then that one's follows; a reset waits for both.
  for (const bool resets : {false, true}) {
    change(settings.young_modulus, resets ? 1e5 : 2e5), change(settings.dt, resets ? 0.004 : 0.003);
    if (resets) reset(sim);
    for (int s = 0; s < 16 && !resets; ++s) step(sim);
    CHECK(second_level(sim) == second_level(create_sim(sim.model, settings)));
  }
}

TEST_CASE("newton: a tet alone, thousands of them, and bodies without constraints fall as all else (long)") {
  GlTest gl;
  TetMesh one;
  one.positions = {{0, 5, 0}, {1, 5, 0}, {0, 6, 0}, {0, 5, 1}};
  one.tets = {{0, 1, 2, 3}};
  finish_tets(one, "tet");
  TetMesh many;
  for (unsigned t = 0; t < 600; ++t) {
    for (const auto& p : one.positions)
      many.positions.push_back(0.1 * p + glm::dvec3(0.2 * (t % 40), 5, 0.2 * (t / 40)));
    many.tets.push_back({4 * t, 4 * t + 1, 4 * t + 2, 4 * t + 3});
  }
  finish_tets(many, "tets");
  for (const TetMesh* mesh : {&one, &many})
    for (const char* material : {"neo-hookean", "none"}) {
      if (mesh == &many && material == std::string("none")) continue;
      auto model = std::make_shared<Model>();
      add_body(*model, "tets", *mesh, 1000, mesh->positions, {}, {}, {});
      Settings settings = soft(material);
      settings.constraints = "", settings.iterations = 4;
      Sim sim = create_sim(model, settings);
      for (int s = 0; s < 20; ++s) step(sim);
      const State state = read_state(sim);
      double off = 0;
      for (std::size_t i = 0; i < state.positions.size(); ++i)
        off = std::max(off, std::abs(model->positions[i].y - state.positions[i].y - 0.5 * 9.81 * 0.01));
      CHECK(off < 1e-5);
    }
}

TEST_CASE("newton: a body moves to the same bits whatever far from it does") {
  GlTest gl;
  const auto beam_and = [](int others) {
    auto model = std::make_shared<Model>();
    const auto add = [&](const char* name, TetMesh mesh, const glm::dvec3& at, const glm::dvec3& spin,
                         std::vector<std::uint32_t> fixed) {
      for (glm::dvec3& p : mesh.positions) p += at;
      add_body(*model, name, mesh, 1000, mesh.positions, {}, spin, fixed);
    };
    add("beam", make_block({1, 0.25, 0.25}, {8, 2, 2}, true), {0, 1, 0}, {}, {0, 1, 2});
    for (int k = 0; k < others; ++k)
      add("cube", make_block({0.3, 0.3, 0.3}, {3, 3, 3}, true), {10 + 3 * k, k == 1 ? 0 : 3, 0}, {20, 5, 0}, {});
    return model;
  };
  std::vector<Position> alone;
  for (const int others : {0, 3}) {  // the second one lies on the ground
    Settings settings = soft("neo-hookean");
    settings.young_modulus = 1e6, settings.iterations = 2;
    const auto model = beam_and(others);
    Sim sim = create_sim(model, settings);
    sim.adaptive.readback = {};  // the length of a substep is that of all
    for (int s = 0; s < 60; ++s) step(sim);
    std::vector<Position> positions = sim.positions.read_all<Position>();
    positions.resize(model->bodies[0].vertices);
    if (others == 0) alone = positions;
    const auto differs = [](const Position& a, const Position& b) { return a.high != b.high || a.low != b.low; };
    CHECK(std::ranges::mismatch(alone, positions, std::not_fn(differs)).in1 == alone.end());
  }
}

TEST_CASE("newton: the same bits twice, other modes go on from where it is, what has no force is refused") {
  GlTest gl;
  const auto model = irregular_block(0.01, true, {1, 0, 0}, {});
  std::uint64_t bits = 0;
  for (int run = 0; run < 2; ++run) {
    Sim sim = create_sim(model, soft("springs", 1e-3));
    for (int s = 0; s < 10; ++s) step(sim);
    if (run == 0) bits = state_hash(sim);
    CHECK(state_hash(sim) == bits);
  }
  const auto free = irregular_block(5, false, {}, {});
  Settings settings = soft("neo-hookean");
  Sim sim = create_sim(free, settings);
  double time = 0;
  for (const char* mode : {"newton", "node", "newton", "explicit", "newton"}) {
    settings.mode = mode, settings.substeps = 3, settings.iterations = 4;
    apply_settings(sim, settings);
    for (int s = 0; s < 10; ++s) step(sim), time += settings.dt;
  }
  const double fall = centre_of(*free, free->positions).y - centre_of(*free, read_state(sim).positions).y;
  CHECK(fall == doctest::Approx(0.5 * 9.81 * time * time).epsilon(1e-3));
  Settings hard;
  hard.mode = "newton";
  CHECK_THROWS_WITH_AS(create_sim(model, hard), doctest::Contains("needs forces, and stretch has none"), Error);
}
