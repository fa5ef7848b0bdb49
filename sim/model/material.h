// Materials: what Young's modulus and Poisson's ratio make of the constraints of a mesh (method.md,
// "Materials").
#pragma once

#include <vector>

#include "sim/model/constraints.h"
#include "sim/model/model.h"
#include "sim/model/settings.h"

namespace tetpbd {

/// Lame's parameters of linear elasticity, Pa.
struct Lame {
  double mu, lambda;
};
Lame lame(double young_modulus, double poisson_ratio);

/// What tet_energy of shaders/energy.glsl is told of it.
glm::vec4 energy_material(const Material& material);
/// Whether it has one.
inline bool has_energy(const Material& material) { return material.material != "none"; }

/// The constraints of a mesh of the kinds that its material uses, with the compliances of its model if it has
/// one.
ConstraintSystem build_constraints(const TetMesh& mesh, const Material& material);
/// Those of all bodies, each of what it is made of; `all`: of bodies without a material of their own.
ConstraintSystem build_constraints(const Model& model, const Material& all);

/// Materials by name: what a scene's "material": "rubber" puts in place.
const std::vector<Preset>& material_presets();

}  // namespace tetpbd
