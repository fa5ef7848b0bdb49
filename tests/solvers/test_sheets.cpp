// Thin sheets: isometric bending against closed forms, masses, motion, contact with solids, what refuses
// them.
#include <doctest/doctest.h>

#include <cmath>
#include <glm/gtc/constants.hpp>
#include <nlohmann/json.hpp>
#include <random>

#include "app/scene.h"
#include "sim/measure/metrics.h"
#include "sim/measure/overlap.h"
#include "sim/model/material.h"
#include "sim/reference/objective.h"
#include "sim/sim.h"
#include "tests/gl_test.h"
#include "tests/mesh/mesh_samples.h"
#include "tests/sim_samples.h"

using namespace tetpbd;

namespace {

Settings cloth(const std::string& mode = "node") {
  Settings s;
  s.mode = mode, s.constraints = "stretch,isobend", s.ground = false;
  s.compliance[index_of<Stretch>] = 1e-6, s.compliance[index_of<Isobend>] = 1e3;
  return s;
}

// Sum of C^2 / 2: of a stiffness of 1 J.
double bending(const TetMesh& mesh, const std::vector<glm::dvec3>& x) {
  const ConstraintSystem system = build_constraints(mesh, "isobend");
  Objective objective{system, {}, {}, {}};
  objective.compliances.fill(1);
  objective.masses.assign(x.size(), 0), objective.predicted = x;
  return energy(objective, x);
}

glm::dmat3 turned(double angle) {
  const double c = std::cos(angle), s = std::sin(angle);
  return glm::dmat3(c, s, 0, -s, c, 0, 0, 0, 1) * glm::dmat3(1, 0, 0, 0, c, s, 0, -s, c);
}

std::vector<glm::dvec3> cylinder(const TetMesh& sheet, double radius) {
  auto x = sheet.positions;
  for (auto& p : x) p = {radius * std::sin(p.x / radius), radius * (1 - std::cos(p.x / radius)), p.z};
  return x;
}

std::shared_ptr<const Model> falling(const std::vector<std::uint32_t>& fixed = {},
                                     const glm::dvec3& spin = glm::dvec3(0)) {
  auto model = std::make_shared<Model>();
  const TetMesh sheet = make_sheet({1, 0.8}, {12, 9});
  add_body(*model, "sheet", sheet, 300, sheet.positions, glm::dvec3(0), spin, fixed);
  return model;
}

// Edges of triangles that go through triangles which they share no vertex with.
int crossings(const TetMesh& mesh, const std::vector<glm::dvec3>& x) {
  int count = 0;
  for (const auto& t : mesh.surface)
    for (std::size_t c = 0; c < 3; ++c) {
      const std::uint32_t a = t[c], b = t[(c + 1) % 3];
      for (const auto& o : mesh.surface) {
        if (std::ranges::any_of(o, [&](std::uint32_t v) { return v == a || v == b; })) continue;
        const glm::dvec3 n = glm::cross(x[o[1]] - x[o[0]], x[o[2]] - x[o[0]]);
        const double from = glm::dot(n, x[a] - x[o[0]]), to = glm::dot(n, x[b] - x[o[0]]);
        if (from * to >= 0) continue;
        const glm::dvec3 p = x[a] + (x[b] - x[a]) * (from / (from - to));
        bool within = true;
        for (std::size_t k = 0; k < 3; ++k)
          within = within && glm::dot(glm::cross(x[o[(k + 1) % 3]] - x[o[k]], p - x[o[k]]), n) > 0;
        count += within;
      }
    }
  return count;
}

}  // namespace

TEST_CASE("sheets: gradients of isobend match finite differences, flat, curved and without a direction") {
  std::mt19937 generator(3);
  std::uniform_real_distribution<double> unit(-1, 1);
  for (const double scale : {1e-3, 1.0, 1e3})
    for (int trial = 0; trial < 100; ++trial) {
      std::array<glm::dvec3, 4> at_rest, x;
      for (auto& p : at_rest) p = scale * glm::dvec3(unit(generator), unit(generator), unit(generator));
      for (auto& p : x) p = scale * glm::dvec3(unit(generator), unit(generator), unit(generator));
      const auto rest = Isobend::rest(at_rest.data());
      CHECK(std::abs(Isobend::evaluate<double>(at_rest.data(), rest.data()).C) < 1e-12 * (1 + std::abs(rest[3])));
      const auto c = Isobend::evaluate<double>(x.data(), rest.data());
      for (std::size_t j = 0; j < 4; ++j)
        for (int a = 0; a < 3; ++a) {
          auto low = x, high = x;
          low[j][a] -= 1e-6 * scale, high[j][a] += 1e-6 * scale;
          const double difference = (Isobend::evaluate<double>(high.data(), rest.data()).C -
                                     Isobend::evaluate<double>(low.data(), rest.data()).C) /
                                    (2e-6 * scale);
          CHECK(std::abs(c.gradient[j][a] - difference) < 1e-5 * glm::length(c.gradient[0]) + 1e-4 / scale);
        }
    }
  // A flat hinge bends across itself; one in a point is a guard's.
  std::array<glm::dvec3, 4> flat = {glm::dvec3(0, 0, 1), glm::dvec3(0, 0, -1), glm::dvec3(-1, 0, 0),
                                    glm::dvec3(1, 0, 0)};
  const auto rest = Isobend::rest(flat.data());
  CHECK(rest[3] == 0);
  const auto c = Isobend::evaluate<double>(flat.data(), rest.data());
  CHECK(c.C == 0);
  CHECK(std::abs(c.gradient[0].y) == doctest::Approx(glm::length(c.gradient[0])));
  // Of a folded one the mirror image is not at rest, though it is as curved.
  auto folded = flat;
  folded[0].y = folded[1].y = 0.5;
  auto mirrored = flat;
  mirrored[0].y = mirrored[1].y = -0.5;
  const auto curved = Isobend::rest(folded.data());
  CHECK(std::abs(curved[3]) > 0.1);
  CHECK(Isobend::evaluate<double>(mirrored.data(), curved.data()).C == doctest::Approx(-2 * curved[3]));
  std::array<glm::dvec3, 4> point{};
  CHECK(Isobend::evaluate<double>(point.data(), rest.data()).guards == GUARD_HINGE);
  CHECK(Isobend::rest(point.data()) == std::array<double, 4>{});
}

TEST_CASE("sheets: bending energy is none for a flat sheet wherever it is, and the same for one turned") {
  const TetMesh sheet = make_sheet({1, 0.6}, {10, 7});
  auto moved = sheet.positions;
  for (auto& p : moved) p = turned(0.7) * p + glm::dvec3(3, -2, 5);
  CHECK(bending(sheet, sheet.positions) == 0);
  CHECK(bending(sheet, moved) < 1e-20);
  auto bent = cylinder(sheet, 0.4);
  const double before = bending(sheet, bent);
  CHECK(before > 1);
  for (auto& p : bent) p = turned(0.7) * p + glm::dvec3(3, -2, 5);
  CHECK(bending(sheet, bent) == doctest::Approx(before).epsilon(1e-10));
}

TEST_CASE("sheets: a strip around a cylinder has three times the energy of a plate of that stiffness") {
  // One family of edges in three bends; each counts a third of its triangles (method.md).
  for (const double radius : {0.5, 1.0, 4.0}) {
    const TetMesh strip = make_sheet({1, 0.25}, {80, 20});
    const double inner = 79.0 / 80, closed = 0.5 / (radius * radius) * 0.25 * inner;
    CHECK(bending(strip, cylinder(strip, radius)) == doctest::Approx(3 * closed).epsilon(0.01));
  }
}

TEST_CASE_FIXTURE(GlTest, "sheets: a bent sheet stores what isobend's compliance says, curved at rest or flat") {
  for (const double at_rest : {0.0, 0.3, -0.5}) {
    TetMesh sheet = make_sheet({1, 0.25}, {40, 10});
    if (at_rest != 0) sheet.positions = cylinder(sheet, 1 / at_rest);
    const auto bent = cylinder(make_sheet({1, 0.25}, {40, 10}), 0.5);
    auto model = std::make_shared<Model>();
    add_body(*model, "sheet", sheet, 300, sheet.positions, glm::dvec3(0), glm::dvec3(0), {});
    Settings settings = cloth();
    settings.compliance[index_of<Stretch>] = 0;  // hard: no energy
    Sim sim = create_sim(model, settings);
    Metrics metrics = create_metrics(*model);
    CHECK(measure_now(metrics, sim).elastic < 1e-9);
    write_state(sim, {bent, model->velocities});
    CHECK(measure_now(metrics, sim).elastic == doctest::Approx(bending(sheet, bent) / 1e3).epsilon(1e-3));
  }
}

TEST_CASE("sheets: a clamped strip sags as a beam does") {
  const int cells = 24;
  const double length = 1, step = length / (cells - 1), rigidity = 0.5, load = 0.1;  // J, N/m^2
  const TetMesh strip = make_sheet({length + step, 4 * step}, {cells, 4});
  const ConstraintSystem system = build_constraints(strip, "stretch,isobend");
  Objective objective{system, {}, {}, {}};
  objective.compliances.fill(1e-5);
  objective.compliances[index_of<Isobend>] = 3 / rigidity;
  objective.masses = lumped_masses(strip, load / 9.81 / strip.thickness);
  objective.gravity.y = -9.81, objective.predicted = strip.positions;
  const double clamp = strip.positions[0].x + 1.5 * step;
  for (std::size_t i = 0; i < strip.positions.size(); ++i)
    if (strip.positions[i].x < clamp) objective.masses[i] = 0;
  const Minimum minimum = minimise(objective, strip.positions);  // from flat
  double tip = 0;
  for (const auto& p : minimum.positions) tip = std::min(tip, p.y);
  CHECK(-tip == doctest::Approx(load / (8 * rigidity)).epsilon(0.1));
}

TEST_CASE("sheets: masses are area times thickness times density") {
  TetMesh sheet = make_sheet({2, 1}, {6, 4});
  CHECK(sheet.thickness == doctest::Approx(1e-3 * std::sqrt(5)));
  sheet.thickness = 0.002;
  double sum = 0;
  for (const double m : lumped_masses(sheet, 500)) sum += m;
  CHECK(sum == doctest::Approx(2.0));
  const MeshReport r = report(sheet);
  CHECK(r.vertices == 35);
  CHECK(r.bends == 6 * 4 + 5 * 4 + 6 * 3);
  CHECK(r.edges == r.bends + 20);
  CHECK(r.faces == 48);
  CHECK(r.euler_characteristic == 1);
  CHECK(r.components == 1);
  CHECK(hinges(sheet).size() == r.bends);
}

constexpr const char* two_triangles = "v 0 0 0\nv 1 0 0\nv 0 0 1\nv 1 0 1\nf 1 3 2\nf 2 3 4\n";

TEST_CASE("sheets: an open surface is read as one, its triangles turned alike, two faces of a solid not") {
  const samples::Folder folder;
  const auto file = folder.write("sheet_test.obj", two_triangles);
  SurfaceMesh surface = load_surface(file);
  std::swap(surface.triangles[1][1], surface.triangles[1][2]);
  const TetMesh sheet = sheet_of(surface, "here");
  CHECK(sheet.positions.size() == 4);
  CHECK(hinges(sheet).size() == 1);
  CHECK_THROWS_AS(load_mesh(file, "pYq1.85o/140"), Error);
  surface.positions[0].x = NAN;
  CHECK_THROWS_WITH(sheet_of(surface, "here"), doctest::Contains("finite"));
}

TEST_CASE("sheets: scenes have them, flat or from a file, and say what is wrong") {
  const samples::Folder folder;
  folder.write("sheet_test.obj", two_triangles);
  const auto scene_of = [&](const std::string& body, const std::string& solver = "{}") {
    const std::string text = R"({"bodies": [)" + body + R"(], "solver": )" + solver + "}";
    return load_scene(folder.write("sheet_test.json", text).string());
  };
  const Scene scene = scene_of(
      R"({"sheet": {"size": [1, 2], "cells": [4, 8]}, "rotation": [90, 0, 0], "density": 200,
          "fixed": [{"low": [0, 0, 0], "high": [0, 1, 0]}]},
         {"mesh": "sheet_test.obj", "thickness": 0.01}, {"block": {"size": [1, 1, 1], "cells": [1, 1, 1]}})");
  const auto model = build_model(scene);
  CHECK(model->bodies[0].name == "sheet");
  CHECK(model->bodies[0].is_sheet());
  CHECK(model->bodies[1].triangles == 2);
  CHECK_FALSE(model->bodies[2].is_sheet());
  double first = 0, second = 0;
  for (std::size_t i = 0; i < 45; ++i) first += model->masses[i];
  for (std::size_t i = 45; i < 49; ++i) second += model->masses[i];
  CHECK(first == doctest::Approx(2 * 200 * 1e-3 * std::sqrt(5)));
  CHECK(second == doctest::Approx(10));
  CHECK(std::ranges::count(model->inverse_masses, 0.0) == 1);
  const auto again = folder.write("sheet_test.json", scene_json(scene).dump());
  CHECK(build_model(load_scene(again.string()))->masses == model->masses);
  const char* flat = R"({"sheet": {"size": [1, 2], "cells": [4, 8]}, "height": 1})";
  CHECK_THROWS_WITH(build_model(scene_of(flat)), doctest::Contains("has no height"));
  CHECK_THROWS_WITH(scene_of(R"({"block": {"size": [1, 1, 1], "cells": [1, 1, 1]}, "thickness": 1})"),
                    doctest::Contains("is of a sheet"));
  Settings paper;
  paper.mode = "paper", paper.constraints = "stretch,isobend";
  CHECK_THROWS_WITH(check_settings(paper, "here"), doctest::Contains("paper has no isobend"));
  Settings rubber;
  rubber.material = "neo-hookean";
  CHECK_THROWS_WITH(build_constraints(model->rest, rubber), doctest::Contains("sheet has no material"));
}

TEST_CASE("sheets: a step on the GPU is that of the CPU in double") {
  GlTest gl;
  for (const std::string mode : {"node", "constraint"})
    for (const double damping : {0.0, 0.002}) {
      CAPTURE(mode);
      Settings settings = cloth(mode);
      settings.substeps = 5, settings.constraint_damping = damping;
      Sim sim = create_sim(falling({0, 12}, {0, 0, 3}), settings);
      for (int s = 0; s < 10; ++s) step(sim);
      const State expected = samples::reference_after(sim, 2, Sweep::jacobi);
      step(sim), step(sim);
      CHECK(samples::distance(read_state(sim), expected) < 1e-5);
    }
}

TEST_CASE("sheets: one in free fall keeps its momentum, one held at two corners comes to no more energy") {
  GlTest gl;
  for (const std::string mode : {"node", "explicit", "newton", "cpu-fast"}) {
    CAPTURE(mode);
    Settings settings = cloth(mode);
    settings.compliance[index_of<Stretch>] = 1e-4;
    if (mode == "newton") settings.iterations = 8, settings.substeps = 2;
    Sim sim = create_sim(falling({}, {2, 1, 3}), settings);
    Metrics metrics = create_metrics(*sim.model, sim.system);
    const Measurement before = measure_now(metrics, sim);
    for (int s = 0; s < 20; ++s) step(sim);
    const Measurement after = measure_now(metrics, sim);
    CHECK(after.finite());
    const double mass = metrics.mass, fall = 9.81 * 20 * settings.dt;
    CHECK(glm::length(after.momentum - before.momentum + glm::dvec3(0, mass * fall, 0)) < 1e-4 * mass * fall);
    CHECK(after.volume_error_percent == 0);
    CHECK(after.stretch_max < 0.05);

    Sim held = create_sim(falling({0, 12}), settings);
    Metrics held_metrics = create_metrics(*held.model, held.system);
    const double start = measure_now(held_metrics, held).energy();
    for (int s = 0; s < 60; ++s) {
      step(held);
      if (s % 20 == 19) CHECK(measure_now(held_metrics, held).energy() < start + 0.01 * mass * 9.81);
    }
    REQUIRE_FALSE(check_finite(held, true));
    CHECK(bounds(read_state(held).positions).low.y < -0.4);
  }
}

TEST_CASE("sheets: one that falls on a fixed block lies on it, on the GPU and on the CPU") {
  GlTest gl;
  auto model = std::make_shared<Model>();
  TetMesh block = make_block({0.6, 0.4, 0.6}, {6, 4, 6}), sheet = make_sheet({1, 1}, {16, 16});
  std::vector<std::uint32_t> all(block.positions.size());
  for (std::uint32_t i = 0; i < all.size(); ++i) all[i] = i;
  add_body(*model, "block", block, 1000, block.positions, glm::dvec3(0), glm::dvec3(0), all);
  auto start = sheet.positions;
  for (auto& p : start) p.y += 0.3;
  add_body(*model, "sheet", sheet, 300, start, glm::dvec3(0), glm::dvec3(0), {});
  for (const std::string mode : {"node", "cpu-double"}) {
    CAPTURE(mode);
    Settings settings = cloth(mode);
    settings.contact = "bodies", settings.substeps = 10, settings.damping = 1;
    Sim sim = create_sim(model, settings);
    for (int s = 0; s < (mode == "node" ? 160 : 60); ++s) step(sim);
    REQUIRE_FALSE(check_finite(sim, true));
    const State state = read_state(sim);
    double deepest = 0, lowest = 1, on_top = 0;
    for (std::size_t i = model->bodies[1].first_vertex; i < state.positions.size(); ++i) {
      const glm::dvec3 p = state.positions[i], inside = glm::dvec3(0.3, 0.2, 0.3) - glm::abs(p);
      deepest = std::max(deepest, std::min({inside.x, inside.y, inside.z}));
      lowest = std::min(lowest, p.y);
      on_top += inside.x > 0 && inside.z > 0 && std::abs(p.y - 0.2) < 0.03;
    }
    CHECK(deepest < 0.01 * model->size);
    CHECK(on_top > 60);
    CHECK(lowest < 0.1);  // the rim hangs
    CHECK(lowest > -0.5);
    if (mode == "node") CHECK(touched(sim).touches > 100);
  }
}

TEST_CASE("sheets: a ball and another sheet fall on one that is held, and stay on their side of it") {
  GlTest gl;
  auto model = std::make_shared<Model>();
  const TetMesh held = make_sheet({1, 1}, {16, 16}), other = make_sheet({0.4, 0.5}, {8, 10});
  TetMesh ball = make_block({0.2, 0.2, 0.2}, {4, 4, 4});
  for (auto& p : ball.positions)
    if (const double l = glm::length(p); l > 0) p *= std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)}) / l;
  finish_tets(ball, "ball");
  std::vector<std::uint32_t> rim;
  for (std::uint32_t i = 0; i < held.positions.size(); ++i)
    if (std::max(std::abs(held.positions[i].x), std::abs(held.positions[i].z)) > 0.499) rim.push_back(i);
  const auto add = [&](const TetMesh& mesh, double aside, double height, const std::vector<std::uint32_t>& fixed) {
    auto start = mesh.positions;
    for (auto& p : start) p += glm::dvec3(aside, height, 0.01);
    add_body(*model, "body", mesh, 300, start, glm::dvec3(0), glm::dvec3(0), fixed);
  };
  add(held, 0.02, 0, rim), add(other, -0.23, 0.08, {}), add(ball, 0.22, 0.25, {});
  for (const std::string mode : {"node", "cpu-double"}) {
    CAPTURE(mode);
    Settings settings = cloth(mode);
    settings.constraints = "stretch,isobend", settings.contact = "bodies", settings.substeps = 20;
    settings.damping = 1, settings.friction = 0.3;
    Sim sim = create_sim(model, settings);
    for (int s = 0; s < (mode == "node" ? 160 : 60); ++s) step(sim);
    REQUIRE_FALSE(check_finite(sim, true));
    const State state = read_state(sim);
    CHECK(crossings(model->rest, state.positions) == 0);
    CHECK(measure_overlap(*model, state.positions, true).crossings.pairs == 0);
    const auto lowest = [&](std::size_t body) {
      double low = 1;
      for (std::size_t i = 0; i < model->bodies[body].vertices; ++i)
        low = std::min(low, state.positions[model->bodies[body].first_vertex + i].y);
      return low;
    };
    CHECK(lowest(0) < -0.01);  // it bears them
    CHECK(lowest(1) > lowest(0));
    CHECK(lowest(2) > lowest(0));
    if (mode == "node") CHECK(touched(sim).touches > 100);
  }
}

TEST_CASE("sheets: one that folds onto itself does not go through itself where that is asked for (long)") {
  GlTest gl;
  auto model = std::make_shared<Model>();
  const TetMesh sheet = make_sheet({0.4, 1}, {12, 30});
  auto start = sheet.positions;  // one half above the other, a little turned
  for (auto& p : start) {
    const double radius = 0.1, s = p.z, half = 0.5 * glm::pi<double>() * radius;
    if (std::abs(s) < half)
      p = {p.x, 0.13 + radius * std::sin(s / radius), -radius * std::cos(s / radius)};
    else
      p = {p.x + (s > 0 ? 0.2 * (s - half) : 0), s > 0 ? 0.23 : 0.03, std::abs(s) - half};
  }
  add_body(*model, "sheet", sheet, 300, start, glm::dvec3(0), glm::dvec3(0), {});
  model->obstacles.push_back(samples::half_space({0, 1, 0}));
  int through = 0;
  for (const std::string contact : {"none", "self"}) {
    CAPTURE(contact);
    Settings settings = cloth();
    settings.contact = contact, settings.substeps = 20, settings.damping = 0.5, settings.friction = 0.3;
    Sim sim = create_sim(model, settings);
    int most = 0;
    for (int s = 0; s < 200; ++s) {
      step(sim);
      if (s % 10 == 9) most = std::max(most, crossings(sheet, read_state(sim).positions));
    }
    const auto end = read_state(sim).positions;
    CHECK((measure_overlap(*model, end, true).crossings.pairs == 0) == (crossings(sheet, end) == 0));
    CHECK(measure_overlap(*model, end, false).crossings.pairs == 0);
    REQUIRE_FALSE(check_finite(sim, true));
    if (contact == "none")
      through = most;
    else
      CHECK(most == 0);
  }
  CHECK(through > 10);
}
