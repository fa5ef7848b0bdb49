// A block that tests step, and the same step in double.
#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>

#include "sim/sim.h"
#include "sim/solvers/cpu_pbd.h"

namespace samples {

using namespace tetpbd;

// Irregular and asymmetric; 5*4*3 = 60 or 9*7*5 = 315 vertices, no multiple of any work-group.
inline std::shared_ptr<const Model> block_model(glm::ivec3 cells = {8, 6, 4}, double height = 0.2, double scale = 1,
                                                const std::string& deformation = "none",
                                                glm::dvec3 spin = glm::dvec3(0)) {
  TetMesh mesh = make_block(glm::dvec3(1.0, 0.7, 0.5) * scale, cells);
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    auto& p = mesh.positions[i];
    p += 0.02 * scale * glm::dvec3(std::sin(12.9 * double(i)), std::sin(78.2 * double(i)), std::sin(37.7 * double(i)));
    p.y += (0.35 + 0.02 + height) * scale;
    p.x += 0.15 * p.y * p.y / scale;
  }
  finish_tets(mesh, "block");
  auto model = std::make_shared<Model>();
  auto start = mesh.positions;
  deform(start, mesh, deformation, 1);
  add_body(*model, "block", mesh, 1000, start, glm::dvec3(0), spin, {});
  return model;
}

// An icosahedron's faces with its centre, a corner at the bottom.
inline TetMesh ball_mesh(double radius) {
  TetMesh mesh;
  mesh.positions = {{0, 0, 0}, {0, radius, 0}, {0, -radius, 0}};
  for (int k = 0; k < 10; ++k) {
    const double a = k * std::numbers::pi / 5, y = radius / std::sqrt(5.0) * (k % 2 ? -1 : 1);
    mesh.positions.push_back({2 * radius / std::sqrt(5.0) * std::cos(a), y, 2 * radius / std::sqrt(5.0) * std::sin(a)});
  }
  for (std::uint32_t k = 0; k < 10; ++k) {
    const std::uint32_t a = 3 + k, b = 3 + (k + 1) % 10, c = 3 + (k + 2) % 10;
    mesh.tets.push_back({0, a, b, c});
    mesh.tets.push_back({0, k % 2 ? 2u : 1u, a, c});
  }
  finish_tets(mesh, "ball");
  return mesh;
}

/// n.x >= d, of a unit normal.
inline Obstacle half_space(const glm::dvec3& normal, double d = 0) {
  Obstacle o;
  o.normal = normal, o.centre = d * normal;
  return o;
}

inline Settings quick(const std::string& mode, int iterations = 10, int substeps = 1) {
  Settings settings;
  settings.mode = mode, settings.iterations = iterations, settings.substeps = substeps;
  return settings;
}

inline State reference_after(const Sim& sim, int steps, Sweep sweep) {
  CpuPbd<double> pbd(*sim.model, sim.system);
  State state = read_state(sim);
  for (int s = 0; s < steps; ++s)
    pbd.step(state, sim.settings, sim.inverse_masses, sweep, simulated_time(sim) + s * sim.settings.dt);
  return state;
}

inline double distance(const State& a, const State& b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.positions.size(); ++i)
    largest = std::max(largest, glm::length(a.positions[i] - b.positions[i]));
  return largest;
}

}  // namespace samples
