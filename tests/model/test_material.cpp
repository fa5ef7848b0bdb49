// Materials: their formulas, their elasticity at rest, and the modes that solve them.
#include <Eigen/Dense>
#include <nlohmann/json.hpp>

#include "sim/model/material.h"
#include "sim/reference/leapfrog.h"
#include "sim/reference/motion.h"
#include "sim/sim.h"
#include "tests/app/run_program.h"
#include "tests/gl_test.h"
#include "tests/reference/reference_scenes.h"

using namespace reference_scenes;
using namespace run_program;

namespace {

glm::dmat3 random_matrix(double amplitude) { return {noise(amplitude), noise(amplitude), noise(amplitude)}; }

std::array<glm::dvec3, 4> random_tet(double scale) {
  std::array<glm::dvec3, 4> x = {glm::dvec3(0), glm::dvec3(1, 0, 0), glm::dvec3(0, 1, 0), glm::dvec3(0, 0, 1)};
  for (auto& p : x) p = scale * (p + noise(0.3));
  return x;
}

std::array<double, 8> rest_of_tet(std::array<glm::dvec3, 4> x, double alpha) {
  auto rest = NeoHookean::rest(x.data());
  rest[7] = alpha;
  return rest;
}

// Largest difference of `gradient` from central differences of `value`, over its largest.
template <class Value>
double gradient_error(std::array<glm::dvec3, 4> x, double scale, const glm::dvec3* gradient, Value&& value) {
  double worst = 0, largest = 0;
  for (std::size_t j = 0; j < 4; ++j)
    for (int a = 0; a < 3; ++a) {
      const double step = 1e-6 * scale, start = x[j][a];
      x[j][a] = start + step;
      const double high = value(x);
      x[j][a] = start - step;
      const double low = value(x);
      x[j][a] = start;
      worst = std::max(worst, std::abs(gradient[j][a] - (high - low) / (2 * step)));
      largest = std::max(largest, std::abs(gradient[j][a]));
    }
  return worst / largest;
}

}  // namespace

TEST_CASE("material: gradients of neo-hookean tets are those of finite differences") {
  for (const double scale : {1e-3, 1.0, 1e3})
    for (int trial = 0; trial < 100; ++trial) {
      const auto rest = rest_of_tet(random_tet(scale), 1.3);
      auto x = random_tet(scale);
      if (trial % 4 == 0) x[3] = -x[3];  // also inverted
      const auto c = NeoHookean::evaluate(x.data(), rest.data());
      for (int k = 0; k < 2; ++k)
        CHECK(gradient_error(x, scale, c.gradient[k],
                             [&](auto y) { return NeoHookean::evaluate(y.data(), rest.data()).C[k]; }) < 1e-6);
      std::array<glm::vec3, 4> y;
      std::array<float, 8> values;
      for (std::size_t j = 0; j < 4; ++j) y[j] = glm::vec3(x[j] - x[0]);
      std::copy(rest.begin(), rest.end(), values.begin());
      const auto rough = NeoHookean::evaluate(y.data(), values.data());
      for (int k = 0; k < 2; ++k) CHECK(std::abs(rough.C[k] - c.C[k]) < 1e-4 * (std::abs(c.C[0]) + 1));
    }
}

TEST_CASE("material: neo-hookean is Smith's energy, with no stress at rest and linear elasticity about it") {
  const double E = 3e5;
  for (const double nu : {0.0, 0.3, 0.49}) {
    const Lame m = lame(E, nu);
    const double mu = 4.0 / 3 * m.mu, lambda = m.lambda + 5.0 / 6 * m.mu, alpha = 1 + 0.75 * mu / lambda;
    const auto at_rest = random_tet(1);
    const auto rest = rest_of_tet(at_rest, alpha);
    const glm::dmat3 sides(at_rest[1] - at_rest[0], at_rest[2] - at_rest[0], at_rest[3] - at_rest[0]);
    const auto deformed = [&](const glm::dmat3& F) {
      auto x = at_rest;
      for (auto& p : x) p = F * p;
      return x;
    };
    const auto density = [&](const glm::dmat3& F) {  // J/m^3, by the constraints
      const auto x = deformed(F);
      const auto c = NeoHookean::evaluate(const_cast<glm::dvec3*>(x.data()), rest.data());
      return mu / 2 * c.C[0] * c.C[0] + lambda / 2 * c.C[1] * c.C[1];
    };
    const auto smith = [&](const glm::dmat3& F) {
      double I = 0;
      for (int k = 0; k < 3; ++k) I += glm::dot(F[k], F[k]);
      const double J = glm::determinant(F);
      return mu / 2 * (I - 3) + lambda / 2 * (J - alpha) * (J - alpha) - mu / 2 * std::log(I + 1);
    };
    const glm::dmat3 one(1), F = one + random_matrix(0.4), G = one + random_matrix(0.4);
    CHECK(off(density(F) - density(G), smith(F) - smith(G)) < 1e-9);
    const double least = density(one);
    for (int trial = 0; trial < 20; ++trial) {
      const glm::dmat3 u = random_matrix(1e-4), strain = 0.5 * (u + glm::transpose(u));
      double squares = 0, trace = 0;
      for (int k = 0; k < 3; ++k) squares += glm::dot(strain[k], strain[k]), trace += strain[k][k];
      // Both ways, so that what is of third order is gone.
      CHECK(off(density(one + u) + density(one - u) - 2 * least, 2 * m.mu * squares + m.lambda * trace * trace) < 1e-4);
    }
  }
}

TEST_CASE("material: patch test: a homogeneous strain leaves inner vertices without force") {
  Scene scene;
  TetMesh mesh = make_block({1, 0.7, 0.5}, {3, 3, 3});
  generator.seed(11);
  for (auto& p : mesh.positions) p += noise(0.02);
  finish_tets(mesh, "block");
  add_body(scene.model, "block", mesh, 1000, mesh.positions, glm::dvec3(0), glm::dvec3(0), {});
  scene.settings.material = "neo-hookean";
  scene.settings.gravity = 0;
  scene.system = build_constraints(scene.model.rest, scene.settings);
  const Objective elastic = static_objective(scene.input(), scene.model.positions, none);
  std::vector<bool> outside(mesh.positions.size());
  for (const Triangle& t : mesh.surface)
    for (std::uint32_t v : t) outside[v] = true;
  const glm::dmat3 F = glm::dmat3(1) + random_matrix(0.3);
  Points x = scene.model.positions;
  for (auto& p : x) p = F * p;
  const Points forces = gradient(elastic, x), none_at_rest = gradient(elastic, scene.model.positions);
  double inner = 0, outer = 0, rest = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    (outside[i] ? outer : inner) = std::max(outside[i] ? outer : inner, glm::length(forces[i]));
    rest = std::max(rest, glm::length(none_at_rest[i]));
  }
  CHECK(outer > 0);
  CHECK(inner < 1e-11 * outer);
  CHECK(rest < 1e-11 * outer);
}

TEST_CASE("material: springs have the right stiffness averaged over directions, on any mesh") {
  const double delta = 1e-4;
  for (const int cells : {2, 4}) {
    const Scene scene = beam_of("springs", {cells, cells, cells + 1}, 1e6, 0.3, {1, 0.8, 0.5});
    const Lame m = lame(1e6, 0.3);
    const Objective elastic = static_objective(scene.input(), scene.model.positions, none);
    // Strained along a direction, with and without change of volume; strain of second order cancels.
    const auto density = [&](const glm::dmat3& strain) {
      double sum = 0;
      for (const double sign : {1.0, -1.0}) {
        Points x = scene.model.positions;
        for (auto& p : x) p += sign * (strain * p);
        Objective o = elastic;
        o.gravity = glm::dvec3(0);
        sum += energy(o, x) / (2 * 0.4 * delta * delta);
      }
      return sum;
    };
    double along = 0, shear = 0, lattice = 0;
    const int directions = 500;
    for (int i = 0; i < directions; ++i) {
      const double z = 1 - (2 * i + 1.0) / directions, angle = i * pi * (3 - std::sqrt(5.0)), r = std::sqrt(1 - z * z);
      const glm::dvec3 n(r * std::cos(angle), r * std::sin(angle), z);
      const glm::dmat3 dyad = glm::outerProduct(n, n);
      along += density(delta * dyad) / directions;
      shear += density(delta * (dyad - glm::dmat3(1.0 / 3))) / directions;
    }
    CHECK(off(along, m.lambda / 2 + m.mu) < 2e-3);
    CHECK(off(shear, 2 * m.mu / 3) < 2e-3);
    if (cells == 2) continue;
    // A lattice of equal cubes, not these, is 0.69 of that in shear along its axes: 4 face diagonals of 6.
    const Scene cubes = beam_of("springs", {2, 2, 2}, 1e6, 0.3, {1, 1, 1});
    const Objective even = static_objective(cubes.input(), cubes.model.positions, none);
    Points x = cubes.model.positions;
    for (auto& p : x) p.x += delta * p.y;
    Objective o = even;
    o.gravity = glm::dvec3(0);
    lattice = energy(o, x) / (0.5 * m.mu * delta * delta);
    CHECK(off(lattice, 2.5 / 6 * 5 / 3) < 2e-3);
  }
}

TEST_CASE("material: every mode keeps the rest state, and goes where the leapfrog goes as substeps shrink") {
  const GlTest gl;
  for (const std::string material : {"neo-hookean", "springs"})
    for (const double damping : {0.0, 0.002}) {
      Scene scene = beam_of(material, {4, 2, 2}, 2e5, 0.35);
      const auto model = std::make_shared<Model>(scene.model);
      scene.settings.constraint_damping = damping;
      scene.system = build_constraints(scene.model.rest, scene.settings);
      const double h = 0.5 * stable_step(scene.input(), none, scene.model.positions);
      const long steps = long(std::ceil(0.1 / h));
      Leapfrog right = leapfrog(scene.input(), none, scene.start(), 0.1 / double(steps));
      advance(right, steps);
      const State end = make_state(right);
      const double moved = error_to(scene.model, scene.start(), end);
      for (const std::string mode : {"cpu-double", "cpu", "cpu-fast", "node", "constraint", "gauss-seidel"}) {
        CAPTURE(material);
        CAPTURE(mode);
        CAPTURE(damping);
        Settings settings = scene.settings;
        settings.mode = mode, settings.iterations = 1;
        std::array<double, 2> errors;
        for (std::size_t i = 0; i < 2; ++i) {
          settings.substeps = i == 0 ? 50 : 200;
          Sim sim = create_sim(model, settings);
          for (int s = 0; s < 20; ++s) step(sim);
          errors[i] = error_to(scene.model, end, read_state(sim)) / moved;
        }
        CHECK(errors[0] < (damping > 0 ? 0.15 : 0.01));
        CHECK(errors[1] < 0.4 * errors[0] + 2e-4);
        CHECK(errors[1] < (damping > 0 ? 0.05 : 0.002));
        settings.gravity = 0, settings.substeps = 1;
        Sim still = create_sim(model, settings);
        for (int s = 0; s < 5; ++s) step(still);
        CHECK(error_to(scene.model, scene.start(), read_state(still)) < 1e-6);
      }
    }
}

TEST_CASE("material: errors shrink with the substeps as those of a method of first order, in every mode (long)") {
  const GlTest gl;
  for (const bool flies : {false, true}) {
    Scene scene = beam_of("neo-hookean", {4, 2, 2}, 2e5, 0.35);
    if (flies) {
      scene.model.inverse_masses = scene.model.masses;
      for (double& w : scene.model.inverse_masses) w = 1 / w;
      for (std::size_t i = 0; i < scene.model.velocities.size(); ++i)
        scene.model.velocities[i] = glm::cross(glm::dvec3(0.2, 5, 1), scene.model.positions[i]);
    }
    const auto model = std::make_shared<Model>(scene.model);
    const double h = 0.1 * stable_step(scene.input(), none, scene.model.positions);
    Leapfrog right = leapfrog(scene.input(), none, scene.start(), 0.1 / std::round(0.1 / h));
    advance(right, std::lround(0.1 / right.h));
    const State end = make_state(right);
    for (const std::string mode : {"cpu-double", "cpu", "cpu-fast", "node", "constraint"}) {
      CAPTURE(mode);
      Settings settings = scene.settings;
      settings.mode = mode, settings.iterations = 30;  // what is left is the time step's
      std::vector<double> errors;
      for (const int substeps : {4, 8, 16}) {
        settings.substeps = substeps;
        Sim sim = create_sim(model, settings);
        for (int s = 0; s < 20; ++s) step(sim);
        errors.push_back(error_to(scene.model, end, read_state(sim)));
      }
      CHECK(errors[0] / errors[1] == doctest::Approx(2).epsilon(0.2));
      CHECK(errors[1] / errors[2] == doctest::Approx(2).epsilon(0.1));
    }
  }
}

TEST_CASE("material: a soft block that lands comes to rest, shortened by its own weight") {
  const GlTest gl;
  // Without transverse contraction it is a column: rho g H^2 / (2 E).
  const double E = 2e5, height = 0.5, exact = 1000 * 9.81 * height * height / (2 * E);
  Scene scene;
  scene.settings.material = "neo-hookean";
  scene.settings.young_modulus = E, scene.settings.poisson_ratio = 0;
  scene.settings.constraint_damping = 0.02;
  scene.settings.iterations = 1, scene.settings.substeps = 80;
  TetMesh mesh = make_block({0.4, height, 0.4}, {2, 4, 2});
  for (glm::dvec3& p : mesh.positions) p.y += height / 2;
  std::vector<glm::dvec3> start = mesh.positions;
  for (glm::dvec3& p : start) p.y += 0.01;
  add_body(scene.model, "block", mesh, 1000, start, glm::dvec3(0), glm::dvec3(0), {});
  const auto model = std::make_shared<Model>(scene.model);
  const auto shortened = [&](const Points& x) {
    double sum = 0, count = 0;
    for (std::size_t i = 0; i < x.size(); ++i)
      if (model->rest.positions[i].y > height - 1e-9) sum += height - x[i].y, ++count;
    return sum / count;
  };
  // On the mesh, with its lower side held.
  scene.system = build_constraints(scene.model.rest, scene.settings);
  std::vector<double> held = model->inverse_masses;
  for (std::size_t i = 0; i < held.size(); ++i)
    if (model->rest.positions[i].y < 1e-9) held[i] = 0;
  const ReferenceInput input{*model, scene.system, scene.settings, held};
  CHECK(off(shortened(static_equilibrium(input, model->rest.positions, none).state.positions), exact) < 0.003);
  for (const std::string mode : {"cpu-double", "cpu-fast", "node"}) {
    CAPTURE(mode);
    Settings settings = scene.settings;
    settings.mode = mode;
    Sim sim = create_sim(model, settings);
    for (int s = 0; s < 300; ++s) step(sim);
    const State settled = read_state(sim);
    double kinetic = 0, mass = 0;
    for (std::size_t i = 0; i < settled.positions.size(); ++i) {
      kinetic += model->masses[i] / 2 * glm::dot(settled.velocities[i], settled.velocities[i]);
      mass += model->masses[i];
    }
    CHECK(kinetic < 1e-9 * mass * 9.81 * model->size);
    CHECK(off(shortened(settled.positions), exact) < (mode == "node" ? 0.01 : 0.05));
    for (int s = 0; s < 100; ++s) step(sim);
    CHECK(error_to(scene.model, settled, read_state(sim)) < 5e-5);
  }
}

TEST_CASE("material: modes node and constraint give the same bits, and momentum is kept while spinning") {
  const GlTest gl;
  auto model = std::make_shared<Model>();
  const TetMesh mesh = make_block({1, 0.5, 0.4}, {5, 3, 2});
  add_body(*model, "block", mesh, 1000, mesh.positions, {1, 0, 0}, {2, 5, 1}, {});
  Settings settings;
  settings.material = "neo-hookean", settings.young_modulus = 1e5, settings.gravity = 0;
  settings.ground = false;
  std::array<std::uint64_t, 2> hashes;
  for (std::size_t i = 0; i < 2; ++i) {
    settings.mode = i == 0 ? "node" : "constraint";
    Sim sim = create_sim(model, settings);
    const auto momenta = [&](const State& s) {
      std::array<glm::dvec3, 2> sum{};
      for (std::size_t v = 0; v < s.positions.size(); ++v) {
        sum[0] += model->masses[v] * s.velocities[v];
        sum[1] += model->masses[v] * glm::cross(s.positions[v], s.velocities[v]);
      }
      return sum;
    };
    const auto before = momenta(read_state(sim));
    for (int s = 0; s < 40; ++s) step(sim);
    const auto after = momenta(read_state(sim));
    CHECK(glm::length(after[0] - before[0]) < 1e-4 * glm::length(before[0]));
    CHECK(glm::length(after[1] - before[1]) < 1e-2 * glm::length(before[1]));
    hashes[i] = state_hash(sim);
  }
  CHECK(hashes[0] == hashes[1]);
}

TEST_CASE("material: scenes and flags name it, and say what is wrong with it") {
  const Folder folder;
  const auto scene = [&](const std::string& material) {
    std::ofstream(folder.path / "m.json")
        << R"({"bodies": [{"block": {"size": [1, 0.5, 0.5], "cells": [2, 1, 1]}, "material": )" << material << "}]}";
  };
  const auto settings = [&](const std::string& more) {
    const Outcome run = program("run --scene m.json --steps 2 --mode cpu --out r " + more, folder);
    CHECK(run.err == "");
    return nlohmann::json::parse(read(folder.path / "r/stats.json"))["settings"];
  };
  scene(R"("gelatine")");
  CHECK(settings("")["material"] == "neo-hookean");
  CHECK(settings("")["young_modulus"] == 2e4);
  CHECK(settings("--young-modulus 5e4")["young_modulus"] == 5e4);
  CHECK(settings("--material none")["material"] == "none");
  scene(R"({"model": "springs", "young_modulus": 1e5, "poisson_ratio": 0.4})");
  CHECK(settings("")["material"] == "springs");
  CHECK(settings("")["poisson_ratio"] == 0.4);
  const auto refused = [&](const std::string& material, const std::string& message) {
    scene(material);
    const Outcome run = program("run --scene m.json --steps 1 --mode cpu --out r", folder);
    CHECK(run.status == 2);
    CHECK_MESSAGE(run.err.find(message) != std::string::npos, run.err);
  };
  refused(R"("jam")", "there are rubber, gelatine, muscle, foam, clay");
  refused("3", "'bodies.0.material' must be an object in braces");
  refused(R"({"modulus": 3})", "'bodies.0.material.modulus' is not known here");
  refused(R"({"poisson_ratio": 0.5})", "'poisson_ratio' cannot be 0.5");
  refused(R"({"model": "springs", "poisson_ratio": 0.1})", "springs have no Poisson's ratio of 0.1");
}

TEST_CASE("material: bodies of a scene have their own, also beside a sheet and a hard body") {
  const Folder folder;
  std::ofstream(folder.path / "m.json") << R"({"bodies": [
    {"name": "soft", "block": {}, "material": "foam", "friction": 0.9},
    {"name": "firm", "block": {}, "position": [3, 0, 0],
     "material": {"young_modulus": 2e5, "poisson_ratio": 0.3, "constraint_damping": 1e-3}},
    {"name": "cloth", "sheet": {}, "position": [6, 1, 0],
     "material": {"constraints": ["stretch", "isobend"], "compliance_stretch": 1e-5, "compliance_isobend": 10}},
    {"name": "stone", "block": {}, "position": [9, 0, 0], "restitution": 0.5}]})";
  const auto bodies = [&](const std::string& more) {
    const Outcome run = program("run --steps 2 --out r " + more, folder);
    CHECK_MESSAGE(run.status == 0, run.err);
    return nlohmann::json::parse(read(folder.path / "r/stats.json"))["bodies"];
  };
  const auto first = bodies("--scene m.json --mode cpu");
  REQUIRE(first.size() == 4);
  CHECK(first[0]["material"]["model"] == "neo-hookean");
  CHECK(first[0]["material"]["young_modulus"] == 1e5);
  CHECK(first[0]["friction"] == 0.9);
  CHECK(first[1]["material"]["constraint_damping"] == 1e-3);
  CHECK(first[2]["material"]["compliance_stretch"] == 1e-5);
  CHECK(first[2]["material"]["constraints"] == std::vector<std::string>{"stretch", "isobend"});
  CHECK(first[3]["material"]["model"] == "none");
  CHECK(first[3]["restitution"] == 0.5);
  CHECK(first[3]["mass"].get<double>() == doctest::Approx(1000));
  // The scene that a run writes is the same run.
  std::filesystem::copy(folder.path / "r/scene.json", folder.path / "again.json");
  CHECK(bodies("--scene again.json --mode cpu") == first);
  CHECK(bodies("--scene m.json --mode cpu --young-modulus 3e4") == first);  // all but the stone have their own
  CHECK(bodies("--scene m.json --mode cpu --set bodies.1.material.young_modulus=3e4")[1]["material"]["young_modulus"] ==
        3e4);
  const auto refused = [&](const std::string& more, const std::string& message) {
    const Outcome run = program("run --scene m.json --steps 1 --out r " + more, folder);
    CHECK(run.status == 2);
    CHECK_MESSAGE(run.err.find(message) != std::string::npos, run.err);
  };
  refused("--mode newton", "body stone");
  refused("--mode node --set bodies.0.restitution=0.5", "body soft");
  refused("--mode cpu --set bodies.1.material.poisson_ratio=0.7", "bodies.1.material");
  refused("--mode cpu --set bodies.2.material=foam", "a sheet has no material");
}

TEST_CASE("regions: of a scene are boxes, balls and the parts of a file") {
  const Folder folder;
  // Its file cuts the bar into two groups.
  const TetMesh mesh = make_block({1, 0.5, 0.5}, {4, 2, 2});
  std::ofstream msh(folder.path / "bar.msh");
  msh << "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n" << mesh.positions.size() << "\n";
  for (std::size_t v = 0; v < mesh.positions.size(); ++v)
    msh << v + 1 << " " << mesh.positions[v].x << " " << mesh.positions[v].y << " " << mesh.positions[v].z << "\n";
  msh << "$EndNodes\n$Elements\n" << mesh.tets.size() << "\n";
  for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
    double x = 0;
    for (const std::uint32_t v : mesh.tets[t]) x += mesh.positions[v].x;
    msh << t + 1 << " 4 2 " << (x < 0 ? 7 : 9) << " 1";
    for (const std::uint32_t v : mesh.tets[t]) msh << " " << v + 1;
    msh << "\n";
  }
  msh << "$EndElements\n";
  msh.close();
  const auto body = [&](const std::string& shape, const std::string& region) {
    std::ofstream(folder.path / "m.json") << R"({"bodies": [{"name": "bar", )" << shape << R"(, "material": "foam",
      "regions": [{)" << region << R"(, "young_modulus": 5e5, "density": 3000}]}], "solver": {"mode": "cpu"}})";
    const Outcome run = program("run --scene m.json --steps 2 --out r", folder);
    CHECK_MESSAGE(run.status == 0, run.err);
    return nlohmann::json::parse(read(folder.path / "r/stats.json"))["bodies"][0];
  };
  const std::string block = R"("block": {"size": [1, 0.5, 0.5], "cells": [4, 2, 2]})", file = R"("mesh": "bar.msh")";
  const auto boxed = body(block, R"("low": [0, 0, 0], "high": [0.5, 1, 1])"), tagged = body(file, R"("tag": 7)");
  CHECK(boxed["mass"].get<double>() == doctest::Approx(0.25 * (0.5 * 3000 + 0.5 * 1000)));
  CHECK(boxed["regions"] == nlohmann::json::parse(R"([{"young_modulus": 5e5}])"));
  CHECK(tagged["mass"].get<double>() == doctest::Approx(boxed["mass"].get<double>()));
  CHECK(tagged["centre"][0].get<double>() == doctest::Approx(-0.125).epsilon(1e-3));
  const auto ball = body(block, R"("centre": [0, 0.5, 0.5], "radius": 0.3)");
  CHECK(ball["mass"] < boxed["mass"]);
  CHECK(ball["mass"] > 250);
  std::filesystem::copy(folder.path / "r/scene.json", folder.path / "again.json");
  CHECK(program("run --scene again.json --steps 2 --out s", folder).status == 0);
  CHECK(nlohmann::json::parse(read(folder.path / "s/stats.json"))["bodies"][0] == ball);
  const auto refused = [&](const std::string& region, const std::string& message) {
    std::ofstream(folder.path / "m.json") << R"({"bodies": [{"name": "bar", )" << block << R"(, "material": "foam",
      "regions": [{)" << region << R"(}]}]})";
    const Outcome run = program("run --scene m.json --steps 1 --mode cpu --out r", folder);
    CHECK(run.status == 2);
    CHECK_MESSAGE(run.err.find(message) != std::string::npos, run.err);
  };
  refused(R"("young_modulus": 1e5)", "bodies.0.regions.0");
  refused(R"("tag": 7, "young_modulus": 1e5)", "have no tags");
  refused(R"("low": [1.5, 0, 0], "high": [2, 1, 1], "young_modulus": 1e5)", "holds no tet");
  refused(R"("tag": 7, "radius": 0.1, "young_modulus": 1e5)", "a box");
}
