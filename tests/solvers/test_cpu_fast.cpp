// Mode cpu-fast: its colours, its arithmetic, and that the number of threads changes nothing.
#include <doctest/doctest.h>
#include <omp.h>

#include <algorithm>
#include <cmath>

#include "sim/contact/obstacle_kinds.h"
#include "sim/sim.h"
#include "sim/solvers/colours.h"
#include "sim/solvers/cpu_pbd.h"
#include "sim/solvers/lane_math.h"
#include "tests/gl_test.h"

using namespace tetpbd;

namespace {

std::shared_ptr<const Model> skewed_block(glm::ivec3 cells, double height, const std::string& deformation,
                                          const std::vector<std::uint32_t>& fixed = {}) {
  TetMesh mesh = make_block(glm::dvec3(1.0, 0.7, 0.5), cells);
  for (auto& p : mesh.positions) p.y += 0.35 + height, p.x += 0.15 * p.y * p.y;
  finish_tets(mesh, "block");
  auto model = std::make_shared<Model>();
  auto start = mesh.positions;
  deform(start, mesh, deformation, 1);
  add_body(*model, "block", mesh, 1000, start, glm::dvec3(0), glm::dvec3(0, 2, 0), fixed);
  return model;
}

Settings fast(int iterations, int substeps) {
  Settings settings;
  settings.iterations = 25, settings.substeps = 1;
  settings.mode = "cpu-fast", settings.iterations = iterations, settings.substeps = substeps;
  return settings;
}

// In double, one constraint after the other in the order of colours.
State reference(const Sim& sim, GuardCounts& guards) {
  ConstraintSystem system = sim.system;
  for (ConstraintList& list : system.lists) list = coloured(list, sim.model->positions.size()).list;
  CpuPbd<double> pbd(*sim.model, system);
  State state = read_state(sim);
  guards = pbd.step(state, sim.settings, sim.inverse_masses, Sweep::gauss_seidel);
  return state;
}

double distance_between(const State& a, const State& b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.positions.size(); ++i)
    largest = std::max(largest, glm::length(a.positions[i] - b.positions[i]));
  return largest;
}

}  // namespace

TEST_CASE("a colour shares no vertex, and every constraint is in one") {
  const TetMesh mesh = make_block({1, 1, 1}, {4, 3, 2});
  const ConstraintSystem system = build_constraints(mesh, "stretch,bend,volume");
  for (const ConstraintList& list : system.lists) {
    const Coloured colours = coloured(list, mesh.positions.size());
    const std::size_t arity = std::size_t(list.arity);
    for (std::size_t colour = 0; colour + 1 < colours.first.size(); ++colour) {
      const auto at = [&](std::size_t c) { return colours.list.vertices.begin() + std::ptrdiff_t(c * arity); };
      std::vector<std::uint32_t> used(at(colours.first[colour]), at(colours.first[colour + 1]));
      std::sort(used.begin(), used.end());
      CHECK(!used.empty());
      CHECK(std::adjacent_find(used.begin(), used.end()) == used.end());
    }
    const auto rows = [&](const ConstraintList& of) {
      std::vector<std::vector<double>> result;
      for (std::size_t c = 0; c < of.count(); ++c) {
        auto& row = result.emplace_back(of.vertices.begin() + std::ptrdiff_t(c * arity),
                                        of.vertices.begin() + std::ptrdiff_t((c + 1) * arity));
        row.push_back(of.rest[c]);
      }
      std::sort(result.begin(), result.end());
      return result;
    };
    CHECK(rows(colours.list) == rows(list));
  }
}

TEST_CASE("functions for lanes are those of the library to 1e-6") {
  double angle = 0, power = 0;
  for (int i = -2000; i <= 2000; ++i) {
    const float x = float(std::cos(i * 0.00157079)), y = float(std::sin(i * 0.00157079));
    for (float size : {1e-12f, 1.0f, 1e12f})
      angle = std::max(
          angle, std::abs(double(LaneMath::atan(size * y, size * x)) - std::atan2(double(size * y), double(size * x))));
    const float volume = std::pow(10.0f, float(i) * 0.015f);
    power =
        std::max(power, std::abs(double(LaneMath::pow(volume, 2.0f / 3.0f)) / std::pow(double(volume), 2.0 / 3.0) - 1));
  }
  CHECK(angle < 1e-6);
  CHECK(power < 1e-6);
  CHECK(LaneMath::atan(0, 0) == 0);
  CHECK(LaneMath::atan(1, 0) == doctest::Approx(std::atan2(1.0, 0.0)));
  CHECK(LaneMath::atan(-1, 0) == doctest::Approx(std::atan2(-1.0, 0.0)));
}

TEST_CASE("a step of mode cpu-fast is Gauss-Seidel in double in the order of colours") {
  GlTest gl;
  for (const char* kinds : {"stretch", "bend", "volume", "stretch,bend,volume"})
    for (glm::ivec3 cells : {glm::ivec3(1, 1, 1), glm::ivec3(4, 3, 2), glm::ivec3(8, 6, 4)})
      for (int substeps : {1, 3}) {
        CAPTURE(kinds);
        CAPTURE(cells.x);
        CAPTURE(substeps);
        Settings settings = fast(4, substeps);
        settings.constraints = kinds;
        Sim sim = create_sim(skewed_block(cells, -0.01, "stretch:1.2"), settings);
        GuardCounts guards;
        const State before = read_state(sim), expected = reference(sim, guards);
        step(sim);
        CHECK(distance_between(read_state(sim), expected) < 1e-5);
        CHECK(distance_between(read_state(sim), before) > 1e-3);
      }
}

TEST_CASE("mode cpu-fast gives the same bits with any number of threads") {
  GlTest gl;
  for (const char* deformation : {"squash:0.8", "random"}) {
    CAPTURE(deformation);
    const auto model = skewed_block({12, 9, 7}, 0.01, deformation, {0});
    std::uint64_t first = 0;
    GuardCounts guards{};
    for (unsigned threads : {1u, 2u, 3u}) {
      Sim sim = create_sim(model, fast(5, 2), {.threads = threads});
      for (int s = 0; s < 10; ++s) step(sim);
      if (threads == 1) first = state_hash(sim), guards = guard_counts(sim);
      CHECK(state_hash(sim) == first);
      CHECK(guard_counts(sim) == guards);
      CHECK(glm::length(read_state(sim).positions[0] - model->positions[0]) == 0);
    }
  }
}

TEST_CASE("hard states stay finite in mode cpu-fast, and its guards are counted as one after the other") {
  GlTest gl;
  for (const char* deformation : {"point", "line", "flatten", "mirror", "coincident"}) {
    CAPTURE(deformation);
    Sim sim = create_sim(skewed_block({4, 3, 2}, 0.5, deformation), fast(1, 1), {.threads = 2});
    GuardCounts guards;
    reference(sim, guards);
    step(sim);
    // Collapsed states are chaotic: only what cannot depend on rounding is the same.
    if (std::string(deformation) == "coincident") CHECK(guard_counts(sim)[0] == guards[0]);
    if (std::string(deformation) == "point") CHECK(guard_counts(sim)[0] > 0);
    for (int s = 0; s < 50; ++s) step(sim);
    for (const glm::dvec3& p : read_state(sim).positions) CHECK(std::isfinite(p.x + p.y + p.z));
  }
}

namespace {

// In place of an obstacle's distance; looks at nothing of its object, which is a Formulas.
struct FailingDistance : Formulas<double> {
  static inline int thread = 0;
  Surface fail(Solid, vec3) {
    if (omp_get_thread_num() == thread) throw std::runtime_error("no distance");
    return {{0, 1, 0}, 1};
  }
};

}  // namespace

TEST_CASE("what fails in a thread of mode cpu-fast reaches the caller, and the others do not wait for it") {
  GlTest gl;
  auto model = std::make_shared<Model>(*skewed_block({6, 5, 4}, 0.2, "none"));
  model->obstacles.emplace_back().kind = find_obstacle_kind("sphere");
  // Rows are made once for all, so a row is spoilt and put right again.
  auto& distance = const_cast<ObstacleKind*>(find_obstacle_kind("sphere"))->distance;
  const auto right = distance;
  for (const bool rigid : {false, true})
    for (const unsigned threads : {1u, 3u})
      for (FailingDistance::thread = 0; FailingDistance::thread < int(threads); ++FailingDistance::thread) {
        if (rigid && FailingDistance::thread > 0) continue;  // the first alone looks at hard bodies
        CAPTURE(rigid);
        CAPTURE(threads);
        Settings settings = fast(2, 3);
        settings.rigid_contact = rigid;
        Sim sim = create_sim(model, settings, {.threads = threads});
        const State before = read_state(sim);
        distance = static_cast<Formulas<double>::Distance>(&FailingDistance::fail);
        CHECK_THROWS_WITH(step(sim), "no distance");
        distance = right;
        write_state(sim, before);
        step(sim);
        CHECK(distance_between(read_state(sim), before) > 0);
      }
}
