// Scenes whose right answers are known, and measures of states, for the tests of the reference.
#pragma once

#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <random>

#include "sim/error.h"
#include "sim/model/material.h"
#include "tests/reference/reference_steps.h"

namespace reference_scenes {

using namespace tetpbd;

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double pi = 3.14159265358979323846;

inline std::mt19937 generator(11);
inline glm::dvec3 noise(double amplitude) {
  std::uniform_real_distribution<double> unit(-amplitude, amplitude);
  const double x = unit(generator), y = unit(generator), z = unit(generator);
  return {x, y, z};
}

// A model with its constraints and settings, and what the reference takes.
struct Scene {
  Model model;
  ConstraintSystem system;
  Settings settings = [] {
    Settings published;
    published.iterations = 25, published.substeps = 1;
    return published;
  }();
  ReferenceInput input() const { return {model, system, settings, model.inverse_masses}; }
  State start() const { return {model.positions, model.velocities}; }
};

// Irregular: 3 x 2 x 2 cells have 36 vertices, 4 x 3 x 3 have 80. Free in space, 1 m above the ground.
inline Scene block_scene(glm::ivec3 cells = {3, 2, 2}, double irregular = 0.02) {
  TetMesh mesh = make_block({1, 0.7, 0.5}, cells);
  generator.seed(11);
  for (auto& p : mesh.positions) p += noise(irregular) + glm::dvec3(0, 1.5, 0);
  finish_tets(mesh, "block");
  Scene scene;
  add_body(scene.model, "block", mesh, 1000, mesh.positions, glm::dvec3(0.5, 1, 0), glm::dvec3(3, -2, 5), {});
  // Deforms as well as turns: 1 m/s is 5 mm a step.
  for (auto& v : scene.model.velocities) v += noise(1);
  scene.system = build_constraints(scene.model.rest, scene.settings.constraints);
  return scene;
}

// Another, 6 x 5 x 4 vertices, in flight or above the ground; one edge of it held, if `held`.
inline std::shared_ptr<const Model> irregular_block(double height, bool held, const glm::dvec3& velocity = {1, 0, 0},
                                                    const glm::dvec3& spin = {2, -1, 3}) {
  TetMesh mesh = make_block({1, 0.7, 0.5}, {5, 4, 3});
  generator.seed(3);
  for (auto& p : mesh.positions) p += noise(0.02) + glm::dvec3(0, 0.4 + height, 0);
  finish_tets(mesh, "block");
  auto model = std::make_shared<Model>();
  add_body(*model, "block", mesh, 1000, mesh.positions, velocity, spin,
           held ? std::vector<std::uint32_t>{0, 1} : std::vector<std::uint32_t>{});
  return model;
}

// Springs along a line from the origin, built by hand: `positions` at rest, a spring from each vertex to the
// next.
inline Scene chain_scene(const std::vector<glm::dvec3>& positions, const std::vector<double>& inverse_masses) {
  Scene scene;
  scene.settings.ground = false;
  Model& model = scene.model;
  model.rest.positions = model.positions = positions;
  model.velocities.assign(positions.size(), glm::dvec3(0));
  model.inverse_masses = inverse_masses;
  for (double w : inverse_masses) model.masses.push_back(w > 0 ? 1 / w : 0);
  model.size = bounds(positions).size();
  model.bodies.push_back({"chain", 0, positions.size(), 0, 0, 0, 0});
  scene.system.lists.resize(std::size_t(kind_count));
  scene.system.present = {true, false, false};
  scene.system.at_vertex.assign(positions.size(), 2);
  scene.system.lists[0].arity = 2;
  for (std::uint32_t i = 0; i + 1 < positions.size(); ++i) {
    scene.system.lists[0].vertices.insert(scene.system.lists[0].vertices.end(), {i, i + 1});
    scene.system.lists[0].rest.push_back(glm::length(positions[i + 1] - positions[i]));
  }
  return scene;
}

// Of all kinds: materials have their own.
inline const Compliances none = [] {
  Compliances all;
  all.fill(infinity);
  return all;
}();

// Relative; doctest's Approx has a floor of 1.
inline double off(double value, double right) { return std::abs(value / right - 1); }

// What a stiffness goes to as cells are halved twice, by the order that it shows (Aitken).
inline double extrapolated(const std::array<double, 3>& k) {
  return k[2] - (k[1] - k[2]) * (k[1] - k[2]) / (k[0] - 2 * k[1] + k[2]);
}

// A clamped block of `material`, with what a run of it needs.
inline Scene beam_of(const std::string& material, const glm::ivec3& cells, double young_modulus, double poisson_ratio,
                     const glm::dvec3& size = {1, 0.25, 0.25}, bool mirrored = false) {
  Scene scene;
  scene.settings.material = material;
  scene.settings.young_modulus = young_modulus, scene.settings.poisson_ratio = poisson_ratio;
  scene.settings.ground = false;
  const TetMesh mesh = make_block(size, cells, mirrored);
  std::vector<std::uint32_t> fixed;
  const double end = bounds(mesh.positions).low.x;
  for (std::uint32_t i = 0; i < mesh.positions.size(); ++i)
    if (mesh.positions[i].x < end + 1e-9) fixed.push_back(i);
  add_body(scene.model, "beam", mesh, 1000, mesh.positions, glm::dvec3(0), glm::dvec3(0), fixed);
  scene.system = build_constraints(scene.model.rest, scene.settings);
  return scene;
}

// m, by which its free end has sunk, the mean of its vertices.
inline double sag_of(const Scene& scene, const Points& x) {
  double sum = 0;
  int count = 0;
  const Bounds box = bounds(scene.model.positions);
  for (std::size_t i = 0; i < x.size(); ++i)
    if (scene.model.positions[i].x > box.high.x - 1e-9) sum += scene.model.positions[i].y - x[i].y, ++count;
  return sum / count;
}

inline double dot(const std::vector<glm::dvec3>& a, const std::vector<glm::dvec3>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += glm::dot(a[i], b[i]);
  return sum;
}

inline double largest_distance(const std::vector<glm::dvec3>& a, const std::vector<glm::dvec3>& b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) largest = std::max(largest, glm::length(a[i] - b[i]));
  return largest;
}

// RMS of strain (l - d) / d over edges and of (V - V0) / V0 over tets, and the largest angle error in rad.
struct Errors {
  double strain = 0, volume = 0, angle = 0;
};
inline Errors errors_of(const Scene& scene, const std::vector<glm::dvec3>& x) {
  const auto& edges = scene.system.lists[0];
  Errors e;
  for (std::size_t c = 0; c < edges.count(); ++c)
    e.strain += std::pow(glm::length(x[edges.vertices[2 * c]] - x[edges.vertices[2 * c + 1]]) / edges.rest[c] - 1, 2);
  const auto& tets = scene.system.lists[2];
  TetMesh now{x, {}, {}};
  for (std::size_t c = 0; c < tets.count(); ++c) {
    const std::uint32_t* v = tets.vertices.data() + 4 * c;
    e.volume += std::pow(tet_volume(now, {v[0], v[1], v[2], v[3]}) / tets.rest[c] - 1, 2);
  }
  const auto& hinges = scene.system.lists[1];
  for (std::size_t c = 0; c < hinges.count(); ++c) {
    std::array<glm::dvec3, 4> p;
    for (std::size_t j = 0; j < 4; ++j) p[j] = x[hinges.vertices[4 * c + j]];
    e.angle = std::max(e.angle, std::abs(Bend::evaluate<double>(p.data(), hinges.rest[c]).C));
  }
  e.strain = std::sqrt(e.strain / double(edges.count()));
  e.volume = std::sqrt(e.volume / double(tets.count()));
  return e;
}

inline glm::dvec3 centre_of(const Model& model, const std::vector<glm::dvec3>& x) {
  glm::dvec3 sum(0);
  double mass = 0;
  for (std::size_t i = 0; i < x.size(); ++i) sum += model.masses[i] * x[i], mass += model.masses[i];
  return sum / mass;
}

}  // namespace reference_scenes
