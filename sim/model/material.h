// Materials turn Young's modulus and Poisson's ratio into the compliances of a mesh (method.md, "Materials").
#pragma once

#include <span>
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

/// The constraints of a mesh of the kinds that its material uses, with the material model's compliances; `moduli` of
/// each tet, in place of the material's, or empty.
ConstraintSystem build_constraints(const TetMesh& mesh, const Material& material, std::span<const Lame> moduli = {});
/// The constraints of all bodies, their fibres and attachments as the settings' mode solves them; their material is
/// that of bodies without their own. Attachments that have `broken` are left out.
ConstraintSystem build_constraints(const Model& model, const Settings& settings, const std::vector<char>& broken = {});
/// The moduli of a tet: of its region, or of its body.
Lame tet_moduli(const Model& model, const Settings& settings, std::size_t tet);
/// energy_material() of a tet, as the mode solves it.
glm::vec4 tet_energy_material(const Model& model, const Settings& settings, std::size_t tet);
/// The body's material as the mode solves it.
inline Material solved_material(const Body& body, const Settings& settings) {
  return in_mode(material_of(settings, body.number), settings);
}

/// Materials by name, as a scene's "material": "rubber" asks for them.
const std::vector<Preset>& material_presets();

}  // namespace tetpbd
