// Materials turn Young's modulus and Poisson's ratio into the compliances of a mesh (method.md, "Materials").
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

/// The parameters of shaders/energy.glsl; zeros for material "none".
glm::vec4 energy_material(const Material& material);
inline bool has_energy(const Material& material) { return material.material != "none"; }

/// The constraints of a mesh of the kinds that its material uses, with the material model's compliances.
ConstraintSystem build_constraints(const TetMesh& mesh, const Material& material);
/// The constraints of all bodies as the settings' mode solves them; their material is that of bodies without their own.
ConstraintSystem build_constraints(const Model& model, const Settings& settings);
/// The body's material as the mode solves it.
inline Material solved_material(const Body& body, const Settings& settings) {
  return in_mode(material_of(settings, body.number), settings);
}

/// Materials by name, as a scene's "material": "rubber" asks for them.
const std::vector<Preset>& material_presets();

}  // namespace tetpbd
