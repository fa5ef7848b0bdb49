// Beams of two materials and twisted ones: the program's constraints at rest against the theory of beams.
#include "tests/reference/reference_scenes.h"

using namespace reference_scenes;

namespace {

// The sag under its weight of a cantilever of length 1 whose upper half has the modulus `stiff` and the lower 1e6 Pa,
// on n cells across.
double two_layer_sag(int n, double stiff) {
  Scene scene = beam_of("neo-hookean", {8 * n, n, n}, 1e6, 0, {1, 0.125, 0.125}, true);
  scene.settings.gravity = 0.01;
  for (const Tet& tet : scene.model.rest.tets) {
    double y = 0;
    for (const std::uint32_t v : tet) y += scene.model.rest.positions[v].y / 4;
    scene.model.regions.push_back(y > 0);
  }
  scene.settings.bodies = {{.regions = {{.young_modulus = stiff}}}};
  scene.system = build_constraints(scene.model, scene.settings);
  return sag_of(scene, static_equilibrium(scene.input(), scene.model.positions, none).state.positions);
}

// Of a composite beam without Poisson's ratio: bending about the axis where the layers' pulls are even, and shear.
double composite_sag(double stiff) {
  const double b = 0.125, soft = 1e6, q = 1000 * 0.01 * b * b, area = b * b / 2, inertia = b * (b / 2) * b * b / 48;
  const double axis = (stiff - soft) / (stiff + soft) * b / 4;  // above the middle
  const auto bending = [&](double E, double centre) {
    return E * (inertia + area * (centre - axis) * (centre - axis));
  };
  const double EI = bending(stiff, b / 4) + bending(soft, -b / 4), kappa = 5.0 / 6;
  return q / (8 * EI) + q / (2 * kappa * 0.5 * (stiff + soft) / 2 * b * b);
}

// 1 / (N m), the twist over the torque of a bar of square section, by its energy with both ends held.
double torsional_compliance(double length, int n) {
  constexpr double angle = 0.02, side = 0.1;
  Scene scene = beam_of("neo-hookean", {int(length / side) * n, n, n}, 1e6, 0.3, {length, side, side}, true);
  scene.settings.gravity = 0.01;  // without which there is no equilibrium to look for
  Points start = scene.model.rest.positions;
  for (std::size_t v = 0; v < start.size(); ++v) {
    glm::dvec3& x = start[v];
    if (std::abs(x.x) > length / 2 - 1e-9) scene.model.inverse_masses[v] = 0;
    const double turn = angle * x.x / length;
    x = {x.x, std::cos(turn) * x.y - std::sin(turn) * x.z, std::sin(turn) * x.y + std::cos(turn) * x.z};
  }
  scene.system = build_constraints(scene.model, scene.settings);
  const Points x = static_equilibrium(scene.input(), start, none).state.positions;
  const ConstraintList& tets = scene.system.lists[index_of<NeoHookean>];
  const auto energy_of = [&](const Points& at) {
    double sum = 0;
    for (std::size_t c = 0; c < tets.count(); ++c) {
      glm::dvec3 local[4];
      for (std::size_t j = 0; j < 4; ++j) local[j] = at[tets.ends(c)[j]];
      const auto e = NeoHookean::evaluate<double>(local, &tets.rest[8 * c]);
      for (std::size_t k = 0; k < 2; ++k) sum += e.C[k] * e.C[k] / (2 * tets.compliance[2 * c + k]);
    }
    return sum;
  };
  return angle * angle / (2 * (energy_of(x) - energy_of(scene.model.rest.positions)));
}

}  // namespace

TEST_CASE("material: a cantilever of two layers, refined, sags as a composite beam") {
  for (const double stiff : {1e6, 8e6}) {
    const double exact = composite_sag(stiff);
    const double stiffness = extrapolated(
        {exact / two_layer_sag(2, stiff), exact / two_layer_sag(4, stiff), exact / two_layer_sag(8, stiff)});
    MESSAGE(stiff << " Pa: " << stiffness);
    CHECK(off(stiffness, 1) < 0.02);
  }
}

TEST_CASE("material: a twisted bar's torque, refined, is Saint-Venant's") {
  // The ends cannot warp; what they add is the same on bars of two lengths.
  const auto stiffness = [](int n) { return 1 / (torsional_compliance(0.6, n) - torsional_compliance(0.3, n)); };
  const double torque = extrapolated({stiffness(2), stiffness(4), stiffness(8)});
  const double exact = 0.140577 * 1e-4 * 1e6 / 2.6 / 0.3;
  MESSAGE("torque over the right one: " << torque / exact);
  CHECK(off(torque, exact) < 0.02);
}
