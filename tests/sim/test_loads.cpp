// Forces beside gravity, fibres and viscosity, against closed forms in every mode.
#include <doctest/doctest.h>

#include <cmath>
#include <map>
#include <numbers>

#include "sim/measure/metrics.h"
#include "sim/sim.h"
#include "tests/gl_test.h"
#include "tests/sim_samples.h"

using namespace tetpbd;

namespace {

constexpr const char* modes[] = {"node", "constraint", "cpu-double", "cpu-fast", "explicit", "newton", "vbd"};

std::shared_ptr<Model> block(const glm::dvec3& size, const glm::ivec3& cells, const char* held = "") {
  auto model = std::make_shared<Model>();
  const TetMesh mesh = make_block(size, cells, true);
  VertexList fixed;
  for (std::uint32_t v = 0; v < mesh.positions.size(); ++v)
    if (*held && mesh.positions[v].x < -size.x / 2 + 1e-9) fixed.push_back(v);
  add_body(*model, "block", mesh, 1000, mesh.positions, {}, {}, fixed);
  return model;
}

Settings settings_of(const std::string& mode) {
  Settings s;
  s.mode = mode, s.ground = false, s.gravity = 0, s.material = "neo-hookean", s.young_modulus = 1e5;
  if (!solver_mode(s).forces) s.substeps = 20;
  if (solver_mode(s).implicit) s.iterations = 8;
  if (mode == "vbd") s.substeps = 20;  // implicit Euler damps vibrations
  return s;
}

std::vector<std::uint32_t> all_vertices(const Model& model) {
  std::vector<std::uint32_t> all(model.positions.size());
  for (std::uint32_t v = 0; v < all.size(); ++v) all[v] = v;
  return all;
}

glm::dvec3 mean_velocity(const Sim& sim) {
  const State state = read_state(sim);
  glm::dvec3 sum(0);
  double mass = 0;
  for (std::size_t v = 0; v < sim.masses.size(); ++v) sum += sim.masses[v] * state.velocities[v], mass += sim.masses[v];
  return sum / mass;
}

// Steps, and returns what the ledger says of it.
EnergyLedger run(Sim& sim, int steps) {
  Metrics metrics = create_metrics(sim);
  RunErrors errors;
  for (int k = 0; k <= steps; ++k) {
    measure(metrics, sim);
    while (const auto m = collect(metrics, true)) add_measurement(errors, *m, sim);
    if (k < steps) step(sim);
  }
  return errors.ledger;
}

}  // namespace

TEST_CASE("factors over time are linear between their points") {
  CHECK(factor_at({}, 3) == 1);
  const FactorOverTime factors = {{1, 2}, {3, 6}};
  for (const auto& [time, factor] : {std::pair(0.0, 2.0), {1.0, 2.0}, {2.0, 4.0}, {3.0, 6.0}, {9.0, 6.0}})
    CHECK(factor_at(factors, time) == doctest::Approx(factor));
}

TEST_CASE("an acceleration that fades gives the velocity of its integral, and its work is booked (long)") {
  GlTest gl;
  for (const char* mode : modes) {
    CAPTURE(mode);
    auto model = block({0.2, 0.2, 0.2}, {2, 2, 2});
    model->loads.push_back({Load::Kind::acceleration, {2, 0, 1}, 0, all_vertices(*model), {{0, 1}, {0.5, 0}}});
    Sim sim = create_sim(model, settings_of(mode));
    const EnergyLedger ledger = run(sim, 200);
    CHECK(glm::distance(mean_velocity(sim), glm::dvec3(0.5, 0, 0.25)) < 3e-3);
    CHECK(std::abs((ledger.work) / (0.5 * 8 * (0.25 + 0.0625)) - 1) < 0.02);
    CHECK(ledger.relative() < 0.01);
  }
}

namespace {

// Directions of an octahedron whose faces were cut in four so many times, and these faces.
struct Ball {
  std::vector<glm::dvec3> directions = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
  std::vector<Triangle> faces = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4},
                                 {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
  explicit Ball(int levels) {
    for (int level = 0; level < levels; ++level) {
      std::vector<Triangle> finer;
      std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> middles;
      const auto middle = [&](std::uint32_t a, std::uint32_t b) {
        const auto [found, fresh] = middles.try_emplace(std::minmax(a, b), std::uint32_t(directions.size()));
        if (fresh) directions.push_back(glm::normalize(directions[a] + directions[b]));
        return found->second;
      };
      for (const auto& [a, b, c] : faces) {
        const std::uint32_t ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
        for (const Triangle& t : {Triangle{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}}) finer.push_back(t);
      }
      faces = finer;
    }
  }
};

// A shell, three tets to each prism; the vertices inside come first.
TetMesh shell(const Ball& ball, std::uint32_t layers, double inner, double outer) {
  TetMesh mesh;
  const std::uint32_t each = std::uint32_t(ball.directions.size());
  for (std::uint32_t l = 0; l <= layers; ++l)
    for (const glm::dvec3& d : ball.directions) mesh.positions.push_back(d * (inner + (outer - inner) * l / layers));
  for (std::uint32_t l = 0; l < layers; ++l)
    for (Triangle t : ball.faces) {
      std::ranges::sort(t);
      const auto low = [&](std::size_t k) { return t[k] + each * l; };
      const auto high = [&](std::size_t k) { return low(k) + each; };
      for (const Tet& tet : {Tet{low(0), low(1), low(2), high(2)},
                             {low(0), low(1), high(1), high(2)},
                             {low(0), high(0), high(1), high(2)}})
        mesh.tets.push_back(tet);
    }
  finish_tets(mesh, "shell");
  return mesh;
}

}  // namespace

TEST_CASE("pressure inside a thick sphere widens it by Lame's formula (long)") {
  GlTest gl;
  constexpr double inner = 0.06, outer = 0.12, pressure = 50, E = 1e4, nu = 0.3;
  const double a3 = std::pow(inner, 3), b3 = std::pow(outer, 3);
  const double widens = pressure * a3 / (E * (b3 - a3)) * ((1 - 2 * nu) * inner + (1 + nu) * b3 / (2 * inner * inner));
  const auto widened = [&](const char* mode, int levels, std::uint32_t layers) {
    const Ball ball(levels);
    auto model = std::make_shared<Model>();
    const TetMesh mesh = shell(ball, layers, inner, outer);
    add_body(*model, "shell", mesh, 1000, mesh.positions, {}, {}, {});
    // Faces inside look into the hollow, so that pressure out of the body would press inwards.
    Load load{Load::Kind::pressure, {}, -pressure, {}, {}};
    for (std::uint32_t v = 0; v < ball.directions.size(); ++v) load.vertices.push_back(v);
    model->loads.push_back(load);
    Settings s = settings_of(mode);
    s.young_modulus = E, s.poisson_ratio = nu, s.constraint_damping = 0.01;
    Sim sim = create_sim(model, s);
    for (int k = 0; k < 80; ++k) step(sim);
    const State state = read_state(sim);
    double sum = 0;
    for (std::size_t v = 0; v < ball.directions.size(); ++v) sum += glm::length(state.positions[v]) - inner;
    return sum / double(ball.directions.size());
  };
  // What is left is the error of the mesh, a quarter with edges half as long.
  for (const char* mode : {"node", "cpu-fast", "newton"}) {
    CAPTURE(mode);
    const double part = widened(mode, 2, 4) / widens;
    MESSAGE(std::string(mode) << " " << part);
    CHECK(std::abs(part - 0.91) < 0.03);
  }
  const double coarse = widened("explicit", 2, 4) / widens, fine = widened("explicit", 3, 8) / widens;
  MESSAGE("explicit " << coarse << " " << fine);
  CHECK(std::abs(fine - 1) < 0.03);
  CHECK(std::abs((4 * fine - coarse) / 3 - 1) < 0.02);
}

TEST_CASE("wind drags a sheet up to where its force is the weight (long)") {
  GlTest gl;
  for (const char* mode : modes) {
    CAPTURE(mode);
    auto model = std::make_shared<Model>();
    TetMesh sheet = make_sheet({0.5, 0.5}, {6, 6});
    sheet.thickness = 1e-3;
    add_body(*model, "sheet", sheet, 200, sheet.positions, {}, {}, {});
    model->loads.push_back({Load::Kind::wind, {0, 0, 0}, 1.2, all_vertices(*model), {}});
    Settings s = settings_of(mode);
    s.material = "none", s.constraints = "stretch,isobend", s.gravity = 9.81;
    s.compliance[index_of<Stretch>] = 1e-3, s.compliance[index_of<Isobend>] = 100;
    Sim sim = create_sim(model, s);
    const EnergyLedger ledger = run(sim, 200);
    // rho t g A = c v^2 A / 2.
    CHECK(std::abs((-mean_velocity(sim).y) / (std::sqrt(2 * 200 * 1e-3 * 9.81 / 1.2)) - 1) < 0.02);
    CHECK(ledger.relative() < 0.01);
  }
}

TEST_CASE("active fibres shorten a bar by their share of its stiffness, and their work is booked (long)") {
  GlTest gl;
  constexpr double active = 0.02, E = 1e5, fibres = 5e4;
  for (const char* mode : modes) {
    CAPTURE(mode);
    auto model = block({0.4, 0.1, 0.1}, {8, 2, 2});
    Fibres along{{}, {1, 0, 0}, fibres, {{0, 0}, {0.3, active}}};
    for (std::uint32_t t = 0; t < model->rest.tets.size(); ++t) along.tets.push_back(t);
    model->fibres.push_back(along);
    Settings s = settings_of(mode);
    s.poisson_ratio = 0.3, s.damping = 5;
    Sim sim = create_sim(model, s);
    const EnergyLedger ledger = run(sim, 160);
    const State state = read_state(sim);
    double low = 1, high = -1;
    for (const glm::dvec3& x : state.positions) low = std::min(low, x.x), high = std::max(high, x.x);
    // E e + E_f (e + a) = 0
    CHECK(std::abs(((high - low) / 0.4 - 1) / (-active * fibres / (E + fibres)) - 1) < 0.02);
    CHECK(ledger.relative() < 0.01);
    CHECK(ledger.work > 0);
  }
}

TEST_CASE("viscosity makes a bar's first mode decay at the rate of its tensor (long)") {
  GlTest gl;
  // Viscosity of tau times the elastic tensor damps each mode by exp(-w^2 tau t / 2); along a bar w = pi c / (2 L).
  constexpr double E = 1e5, nu = 0.3, length = 0.8, tau = 4e-3;
  const double mu = E / (2 * (1 + nu)), lambda = E * nu / ((1 + nu) * (1 - 2 * nu));
  const double w = std::numbers::pi * std::sqrt(E / 1000) / (2 * length), period = 2 * std::numbers::pi / w;
  for (const char* mode : modes) {
    CAPTURE(mode);
    auto model = block({length, 0.1, 0.1}, {16, 2, 2}, "held");
    for (std::size_t v = 0; v < model->positions.size(); ++v) {
      const double x = model->rest.positions[v].x + length / 2;
      model->positions[v].x += 0.004 * std::sin(std::numbers::pi * x / (2 * length));
    }
    Settings s = settings_of(mode);
    s.poisson_ratio = nu, s.dt = period / 200, s.young_modulus = E;
    s.viscosity = tau * mu, s.bulk_viscosity = tau * (lambda + 2 * mu / 3);
    if (solver_mode(s).implicit) s.substeps = 4;
    if (solver_mode(s).jacobi) s.iterations = 4;
    Sim sim = create_sim(model, s);
    const auto end = [&] {
      const State state = read_state(sim);
      double furthest = -1;
      for (const glm::dvec3& x : state.positions) furthest = std::max(furthest, x.x);
      return furthest - length / 2;
    };
    // Maxima of the end, a period apart.
    std::vector<double> peaks;
    double before = end(), last = before;
    for (int k = 0; k < 460; ++k) {
      step(sim);
      const double now = end();
      if (last > before && last >= now) peaks.push_back(last);
      before = last, last = now;
    }
    REQUIRE(peaks.size() >= 2);
    const double rate = std::log(peaks[0] / peaks[1]) / period;
    MESSAGE(std::string(mode) << " " << rate / (w * w * tau / 2));
    CHECK(std::abs((rate) / (w * w * tau / 2) - 1) < 0.05);
  }
}
