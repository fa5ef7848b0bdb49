// Smoothed tets in double: forces against differences of their energy, what they share with linear tets, and the sag of
// a cantilever, which linear tets miss.
#include "sim/reference/leapfrog.h"
#include "sim/reference/smoothed.h"
#include "sim/solvers/newton_buffers.h"
#include "tests/reference/reference_scenes.h"

using namespace reference_scenes;

namespace {

Scene smooth(Scene scene, double smoothing = automatic) {
  scene.settings.mode = "explicit";
  scene.settings.element = "smoothed", scene.settings.smoothing = smoothing;
  scene.system = build_constraints(scene.model, scene.settings);
  return scene;
}
Objective elastic(const Scene& scene) {
  return {.system = scene.system,
          .compliances = none,
          .masses = std::vector<double>(scene.model.masses.size(), 0),
          .predicted = scene.model.rest.positions};
}
Points moved(const Scene& scene, const std::function<glm::dvec3(const glm::dvec3&)>& f) {
  Points x;
  for (const glm::dvec3& p : scene.model.rest.positions) x.push_back(f(p));
  return x;
}
double largest_of(const Points& forces) { return largest_distance(forces, Points(forces.size(), glm::dvec3(0))); }

Scene mirrored_beam(const glm::ivec3& cells, double E, double nu) {
  return beam_of("neo-hookean", cells, E, nu, {1, 0.25, 0.25}, true);
}
Minimum hanging(const Scene& scene) {
  Objective o = elastic(scene);
  for (std::size_t i = 0; i < o.masses.size(); ++i)
    o.masses[i] = scene.model.inverse_masses[i] > 0 ? scene.model.masses[i] : 0;
  o.gravity = {0, -scene.settings.gravity, 0};
  o.unit = 1e-3;
  return minimise(o, scene.model.rest.positions);
}
}  // namespace

TEST_CASE("smoothed tets: the gradient is that of the energy, wherever the body is") {
  for (const double nu : {0.2, 0.45, 0.495}) {
    CAPTURE(nu);
    const Scene scene = smooth(beam_of("neo-hookean", {3, 2, 2}, 1e5, nu));
    const Objective o = elastic(scene);
    generator.seed(5);
    Points x = moved(scene, [](const glm::dvec3& p) { return p + noise(0.05) + glm::dvec3(0, 3, 0); });
    const Points all = gradient(o, x);
    constexpr double reach = 1e-6;
    for (std::size_t i = 0; i < x.size(); ++i)
      for (int a = 0; a < 3; ++a) {
        const double before = x[i][a];
        x[i][a] = before + reach;
        const double above = energy(o, x);
        x[i][a] = before - reach;
        const double below = energy(o, x);
        x[i][a] = before;
        CHECK(std::abs((above - below) / (2 * reach) - all[i][a]) < 1e-6 * largest_of(all));
      }
  }
}

TEST_CASE("smoothed tets: leapfrog has the same forces") {
  Scene scene = smooth(beam_of("neo-hookean", {3, 2, 2}, 1e5, 0.45));
  scene.settings.gravity = 0;
  generator.seed(5);
  const Points x = moved(scene, [](const glm::dvec3& p) { return p + noise(0.05); });
  const Points g = gradient(elastic(scene), x);
  const Leapfrog run = leapfrog(scene.input(), none, {x, Points(x.size(), glm::dvec3(0))}, 2);
  for (std::size_t i = 0; i < x.size(); ++i)
    CHECK(glm::length(run.v[i] - g[i] * scene.model.inverse_masses[i]) <
          1e-9 * largest_of(g) * scene.model.inverse_masses.back());
}

TEST_CASE("smoothed tets: Hessian blocks are the changes of forces") {
  const Scene scene = smooth(beam_of("neo-hookean", {2, 2, 2}, 1e5, 0.45));
  generator.seed(5);
  Points x = moved(scene, [](const glm::dvec3& p) { return p + noise(0.05); });
  const std::size_t n = x.size();
  // What averages make of it: stress of F, and resistance of volume; the curvature of J belongs to tets.
  std::vector<glm::dmat3> blocks(n * n, glm::dmat3(0));
  for (std::size_t v = 0; v < n; ++v) {
    const AverageHessian h = average_hessian(scene.system.averages, v, x, false);
    for (std::size_t i = 0; i < h.ids.size(); ++i)
      for (std::size_t j = 0; j < h.ids.size(); ++j) blocks[h.ids[i] * n + h.ids[j]] += h.block(i, j);
  }
  const auto pulls = [&] { return average_forces(scene.system.averages, find_averages(scene.system.averages, x)); };
  const auto volumes = [&] { return find_averages(scene.system.averages, x); };
  constexpr double reach = 1e-6;
  double largest = 0, worst = 0;
  for (std::size_t j = 0; j < n; ++j)
    for (int a = 0; a < 3; ++a) {
      const double before = x[j][a];
      x[j][a] = before + reach;
      const Points above = pulls();
      const auto more = volumes();
      x[j][a] = before - reach;
      const Points below = pulls();
      const auto less = volumes();
      x[j][a] = before;
      // dJ/dx_j of all averages, which the outer products are made of.
      for (std::size_t i = 0; i < n; ++i)
        for (int b = 0; b < 3; ++b) {
          double volume_part = 0;
          for (std::size_t v = 0; v < n; ++v) {
            const double slope = (more[v].J - less[v].J) / (2 * reach);
            if (slope == 0) continue;
            const double kept = x[i][b];
            x[i][b] = kept + reach;
            const double up = average_at(scene.system.averages, v, x).J;
            x[i][b] = kept - reach;
            const double down = average_at(scene.system.averages, v, x).J;
            x[i][b] = kept;
            const auto& vertex = scene.system.averages.vertices[v];
            volume_part += vertex.bulk * vertex.volume * slope * (up - down) / (2 * reach);
          }
          const double right = (below[i][b] - above[i][b]) / (2 * reach) + volume_part;
          largest = std::max(largest, std::abs(right));
          worst = std::max(worst, std::abs(blocks[i * n + j][a][b] - right));
        }
    }
  CHECK(worst < 1e-6 * largest);
}

TEST_CASE("smoothed tets: under one strain everywhere they are linear tets, and turned they are at rest") {
  const Scene linear = beam_of("neo-hookean", {3, 2, 2}, 1e5, 0.4), scene = smooth(linear);
  const auto strained = [](const glm::dvec3& p) {
    return glm::dvec3(1.3 * p.x + 0.2 * p.y, 0.8 * p.y + 0.1 * p.z, 0.1 * p.x + 1.1 * p.z);  // J is 1.15
  };
  const auto stored = [](const Scene& s, const Points& x) {
    return energy(elastic(s), x) - energy(elastic(s), s.model.rest.positions);
  };
  const Points x = moved(scene, strained);
  CHECK(stored(scene, x) == doctest::Approx(stored(linear, x)).epsilon(1e-9));
  const Points a = gradient(elastic(scene), x), b = gradient(elastic(linear), x);
  CHECK(largest_distance(a, b) < 1e-9 * largest_of(b));
  const glm::dmat3 turn(0.36, 0.48, -0.8, -0.8, 0.6, 0, 0.48, 0.64, 0.6);
  const Points turned = moved(scene, [&](const glm::dvec3& p) { return turn * p + glm::dvec3(7, 8, 9); });
  CHECK(largest_of(gradient(elastic(scene), turned)) < 1e-9 * largest_of(b));
  CHECK(std::abs(stored(scene, turned)) < 1e-9 * stored(scene, x));
}

TEST_CASE("smoothed tets: where a body fills a part of a tet, averages resist as much less, and softened as well") {
  const Scene linear = beam_of("neo-hookean", {3, 2, 2}, 1e5, 0.4), whole = smooth(linear);
  generator.seed(3);
  TetMesh mesh = whole.model.rest;
  const auto filled = [&](const auto& share) {
    Model model;
    mesh.fill.clear();
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) mesh.fill.push_back(float(share(t)));
    add_body(model, "beam", mesh, 1000, mesh.positions, glm::dvec3(0), glm::dvec3(0), {});
    return model;
  };
  const auto stored = [](const Model& model, const Settings& settings, const Points& x) {
    Scene s{model, build_constraints(model, settings), settings};
    return energy(elastic(s), x) - energy(elastic(s), model.rest.positions);
  };
  // Under one strain everywhere what is stored is in proportion to the volume that is filled.
  const Model half = filled([](std::size_t) { return 0.5; });
  const Model uneven = filled([](std::size_t t) { return t % 3 == 0 ? 0.25 : 1.0; });
  const Points x = moved(whole, [](const glm::dvec3& p) {
    return glm::dvec3(1.2 * p.x + 0.2 * p.y, 0.9 * p.y + 0.1 * p.z, 0.1 * p.x + 1.1 * p.z);
  });
  const double all = stored(whole.model, whole.settings, x);
  CHECK(stored(half, whole.settings, x) == doctest::Approx(all / 2).epsilon(1e-6));
  CHECK(stored(uneven, whole.settings, x) ==
        doctest::Approx(all * filled_volume(uneven.rest) / filled_volume(whole.model.rest)).epsilon(1e-6));
  CHECK(stored(uneven, whole.settings, x) == doctest::Approx(stored(uneven, linear.settings, x)).epsilon(1e-6));
  // A body of half the stiffness stores half as much, wherever it is.
  const Points scattered = moved(whole, [](const glm::dvec3& p) { return p + noise(0.05); });
  Scene soft = whole;
  soft.system = soften(whole.system, whole.model, {0.5f});
  const auto of = [&](const Scene& s) {
    return energy(elastic(s), scattered) - energy(elastic(s), s.model.rest.positions);
  };
  CHECK(of(soft) == doctest::Approx(of(whole) / 2).epsilon(1e-6));
}

TEST_CASE("smoothed tets: newton's minimiser ends fast at large strains") {
  for (const double nu : {0.3, 0.49}) {
    CAPTURE(nu);
    Scene scene = smooth(beam_of("neo-hookean", {8, 2, 2}, 2e5, nu));
    const Minimum rest = hanging(scene);
    CHECK(rest.converged);
    CHECK(rest.iterations < 30);
    CHECK(sag_of(scene, rest.positions) > 0.1);
  }
}

// Ten-node tets on 32 x 8 x 8 cells sag so many times as far as linear ones on 16 x 4 x 4 mirrored cells.
TEST_CASE("smoothed tets: a cantilever sags as it should, where linear tets lack a fifth") {
  for (const auto& [nu, right] : {std::pair(0.3, 1 / 0.857), std::pair(0.45, 1 / 0.830), std::pair(0.49, 1 / 0.810)}) {
    CAPTURE(nu);
    const Scene linear = mirrored_beam({16, 4, 4}, 5e7, nu);
    const double ratio =
        sag_of(smooth(linear), hanging(smooth(linear)).positions) / (right * sag_of(linear, hanging(linear).positions));
    MESSAGE("sag over the right one, ratio ", nu, ": ", ratio);
    CHECK(ratio > 0.98);
    CHECK(ratio < 1.02);
  }
}

TEST_CASE("smoothed tets: undamped they swing with the period of a beam, and keep their energy") {
  // Let go from where it hangs, which is nearly its first vibration. By Rayleigh's quotient of Timoshenko's beam, with
  // the inertia of turning; for a cantilever that is 0.8 % above the first vibration's square.
  const double E = 1e6, nu = 0.3, b = 0.25, density = 1000;
  Scene scene = smooth(mirrored_beam({16, 4, 4}, E, nu));
  scene.settings.gravity = 1;
  const Points start = hanging(scene).positions;
  const double bending = E * b * b * b * b / 12, q = density * b * b,
               shear = 10 * (1 + nu) / (12 + 11 * nu) * E / (2 * (1 + nu)) * b * b;
  double work = 0, squares = 0;
  for (double x = 0.0005; x < 1; x += 0.001) {
    const double w = q / (24 * bending) * x * x * (x * x - 4 * x + 6) + q / shear * (x - x * x / 2),
                 turn = q / (6 * bending) * x * (x * x - 3 * x + 3);
    work += w, squares += w * w + b * b / 12 * turn * turn;
  }
  const double half_period = pi / std::sqrt(work / squares / 1.008);
  scene.settings.gravity = 0;
  const double h = 0.7 * stable_step(scene.input(), none, scene.model.positions);
  Leapfrog run = leapfrog(scene.input(), none, {start, scene.start().velocities}, h);
  const auto total = [&] {
    const State now = make_state(run);
    double kinetic = 0;
    for (std::size_t i = 0; i < now.velocities.size(); ++i)
      kinetic += 0.5 * scene.model.masses[i] * glm::dot(now.velocities[i], now.velocities[i]);
    return kinetic + energy(elastic(scene), now.positions) - energy(elastic(scene), scene.model.rest.positions);
  };
  const double first = total();
  double before = sag_of(scene, run.x), fell = 0;
  while (true) {
    advance(run, 1);
    const double sag = sag_of(scene, run.x), speed = sag - before;
    if (speed > 0 && fell < 0) break;
    before = sag, fell = speed;
  }
  MESSAGE("half period over theory: ", run.time[0] / half_period);
  CHECK(run.time[0] / half_period == doctest::Approx(1).epsilon(0.02));
  advance(run, 10000);
  CHECK(total() == doctest::Approx(first).epsilon(1e-3));
}

TEST_CASE("smoothed tets: modes without them solve linear ones, and averages keep to their body") {
  Scene scene = smooth(beam_of("neo-hookean", {3, 2, 2}, 1e5, 0.3));
  CHECK(scene.system.lists[index_of<Smoothed>].count() == 72);
  CHECK(smoothing_of(scene.settings) == doctest::Approx(0.45));
  scene.settings.poisson_ratio = 0.49;
  CHECK(smoothing_of(scene.settings) == doctest::Approx(0.311));
  scene.settings.mode = "node";
  const ConstraintSystem linear = build_constraints(scene.model, scene.settings);
  CHECK(linear.lists[index_of<NeoHookean>].count() == 72);
  CHECK(linear.averages.vertices.empty());
  // A body of linear tets before and behind one of smoothed tets.
  Model model;
  const TetMesh mesh = scene.model.rest;
  for (const char* element : {"linear", "smoothed", "linear"}) {
    add_body(model, "beam", mesh, 1000, mesh.positions, glm::dvec3(0), glm::dvec3(0), {});
    Settings own = scene.settings;
    own.element = element;
    scene.settings.bodies.push_back({.material = own});
  }
  scene.settings.mode = "newton";
  const ConstraintSystem both = build_constraints(model, scene.settings);
  CHECK(both.lists[index_of<NeoHookean>].count() == 144);
  CHECK(both.lists[index_of<Smoothed>].count() == 72);
  REQUIRE(both.averages.vertices.size() == model.positions.size());
  const Body& middle = model.bodies[1];
  for (std::size_t v = 0; v < model.positions.size(); ++v) {
    const bool within = v >= middle.first_vertex && v < middle.first_vertex + middle.vertices;
    CHECK((both.averages.vertices[v].volume > 0) == within);
    CHECK((both.averages.first_neighbour[v + 1] > both.averages.first_neighbour[v]) == within);
  }
  for (const Averages::Neighbour& n : both.averages.neighbours) {
    CHECK(n.vertex >= middle.first_vertex);
    CHECK(n.vertex < middle.first_vertex + middle.vertices);
  }
}
