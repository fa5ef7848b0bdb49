// All settings. Each is described once, by a row from which its flag, scene key, widget and documentation follow.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "sim/model/constraint_kinds.h"

namespace tetpbd {

/// The value of a number that is left to the mode, or to the material.
inline constexpr int automatic = -1;

/// The surroundings of all bodies, without the obstacles of the model.
struct World {
  double gravity = 9.81;  ///< m/s^2, downwards
  bool ground = true;
  double ground_height = 0;             ///< m
  double friction = 0.5;                ///< of obstacles and bodies without their own
  double restitution = 0;               ///< of hard bodies, where an obstacle has none of its own
  std::string contact = "none";         ///< of bodies with each other: none, bodies, self
  double contact_distance = automatic;  ///< m, that their surfaces keep; automatic: by their edges and thickness
  bool operator==(const World&) const = default;
};

/// The material of a body: a material model and its moduli, or kinds of constraint and their coefficients.
struct Material {
  std::string material = "none";  ///< the model (material.h), in place of kinds, stiffness and compliance
  double young_modulus = 1e6;     ///< Pa
  double poisson_ratio = 0.3;
  std::string element = "linear";  ///< of neo-Hookean tets: linear or smoothed
  double smoothing = automatic;    ///< s, the part of a smoothed tet's resistance to shear that is its own
  double constraint_damping = 0;   ///< s
  double viscosity = 0;            ///< Pa s, of neo-Hookean tets, against shear
  double bulk_viscosity = 0;       ///< Pa s, likewise, against a change of volume
  double yield_strain = 0;         ///< of neo-Hookean tets, beyond which they keep their shape; 0: they never do
  double creep_time = 0;           ///< s, in which what is beyond flows; 0: at once
  std::string constraints = "stretch,bend,volume";
  std::array<double, kind_count> stiffness = [] {  ///< k_NAME by kind, 0 to 1
    std::array<double, kind_count> hard;
    hard.fill(1);
    return hard;
  }();
  std::array<double, kind_count> compliance{};  ///< compliance_NAME by kind
  bool operator==(const Material&) const = default;
};

/// How a step is solved.
struct SolverSettings {
  std::string mode = "node";
  int iterations = automatic;
  int substeps = automatic;
  double dt = 0.005;            ///< s
  double stability = 0.4;       ///< in mode explicit, a substep over the longest that is stable at rest
  double mass_scaling = 0.001;  ///< in mode explicit, the part of a body's mass that may be added where it is stiffest
  double omega = 1.5;
  double acceleration = 0;  ///< in mode vbd, the spectral radius that its sweeps are taken to have
  bool mass_splitting = true;
  double damping = 0;  ///< 1/s
  bool rigid_contact = true;
  int seed = 1;
  bool operator==(const SolverSettings&) const = default;
};

/// Of a region of a body, in place of those of its material.
struct RegionModuli {
  std::optional<double> young_modulus{};  ///< Pa
  std::optional<double> poisson_ratio{};
  bool operator==(const RegionModuli&) const = default;
};

/// What a body has of its own, in place of the settings' material and the world's friction and restitution.
struct BodySettings {
  std::optional<Material> material{};
  std::optional<double> friction{};     ///< on obstacles without their own, and on other bodies
  std::optional<double> restitution{};  ///< likewise, of a hard body
  std::vector<RegionModuli> regions{};  ///< as Model::regions counts them; more or fewer are of no harm
  bool operator==(const BodySettings&) const = default;
};

/// The settings that the user asked for. Only the user changes them; what they mean for a step is its Plan.
struct Settings : World, Material, SolverSettings {
  std::vector<BodySettings> bodies{};  ///< by body of the model; empty: none has anything of its own
  bool operator==(const Settings&) const = default;
};

/// The material of a body, by its number in the model.
inline const Material& material_of(const Settings& settings, std::size_t body) {
  const bool own = !settings.bodies.empty() && settings.bodies[body].material;
  return own ? *settings.bodies[body].material : settings;
}
inline double friction_of(const Settings& settings, std::size_t body) {
  return settings.bodies.empty() ? settings.friction : settings.bodies[body].friction.value_or(settings.friction);
}
inline double restitution_of(const Settings& settings, std::size_t body) {
  return settings.bodies.empty() ? settings.restitution
                                 : settings.bodies[body].restitution.value_or(settings.restitution);
}
/// Whether any body has a material of its own. Each constraint then has its own coefficients.
bool has_own_materials(const Settings& settings);
/// Whether any body has a friction or a restitution of its own, which kernels then read by vertex.
bool has_own_surfaces(const Settings& settings);
/// Whether `is_such` is true of the material of any body, or of all.
bool any_material(const Settings& settings, bool (*is_such)(const Material&));
bool all_materials(const Settings& settings, bool (*is_such)(const Material&));
/// The largest constraint_damping of all bodies, s; above 0 where any is viscous.
double most_damping(const Settings& settings);

/// The substeps of a step, `h` long, and the iterations of each.
struct Plan {
  int substeps = 1, iterations = 1;
  double h = 0;  ///< s
  bool operator==(const Plan&) const = default;
};
/// The plan before anything is known of the bodies: the numbers that were asked for, or the mode's own.
Plan plan_for(const Settings& settings);

/// When a change takes effect: at the next step; by rebuilding the solver, which keeps the state; at a new start.
enum class Effect { live, rebuild, restart };

/// An element of an array by constraint kind.
struct KindMember {
  std::array<double, kind_count> Settings::*array;
  std::size_t kind;
};

struct Parameter {
  std::string name;     ///< scene key; the flag is --name with - for _
  const char* section;  ///< scene section: "solver" or "world"
  std::variant<double Settings::*, int Settings::*, bool Settings::*, std::string Settings::*, KindMember> member;
  std::string help;
  double low = 0, high = 1;  ///< allowed range of a number
  const char* unit = "";
  bool logarithmic = false;  ///< slider scale
  Effect effect = Effect::live;
  bool automatic = false;  ///< also accepts the word auto, which leaves it to the mode or the material
};
/// Calls f with a reference to the parameter's value in `settings`, a double, int, bool or std::string.
template <class S, class F>
decltype(auto) with_value(S& settings, const Parameter& parameter, F&& f) {
  return std::visit(
      [&](auto member) -> decltype(auto) {
        if constexpr (std::is_same_v<decltype(member), KindMember>)
          return f((settings.*member.array)[member.kind]);
        else
          return f(settings.*member);
      },
      parameter.member);
}

const std::vector<Parameter>& parameters();
const Parameter* find_parameter(const std::string& name);  ///< name with - or _; nullptr if there is none

/// Sets one value given as text. Throws Error naming the key, `where` and the allowed values.
void set_parameter(Settings& settings, const Parameter& parameter, const std::string& text, const std::string& where);
/// The value as a text that set_parameter reads.
std::string parameter_text(const Settings& settings, const Parameter& parameter);
std::string flag_name(const Parameter& parameter);  ///< "--k-stretch"
bool is_of_material(const Parameter& parameter);    ///< a member of Material, which a body may have of its own
/// The allowed words of a parameter, of which "constraints" accepts several; empty for numbers.
std::vector<std::string> choices(const Parameter& parameter);
/// Sets the mode, be it one that choices() does not offer. Iterations and substeps become automatic where they mean
/// something else in the new mode (corrections, leapfrog, implicit steps). Throws Error naming `where` for other words.
void set_mode(Settings& settings, const std::string& word, const std::string& where);

/// Settings under a name: those of a solver (--solver) or of a material (material.h).
struct Preset {
  const char *name, *help;
  const char* values;  ///< PARAMETER=TEXT, separated by commas
};
const std::vector<Preset>& solver_presets();
/// Applies the preset of that name; false if there is none.
bool apply_preset(Settings& settings, const std::vector<Preset>& presets, const std::string& name);
std::vector<std::string> preset_names(const std::vector<Preset>& presets);

/// Whether constraints are XPBD's (method.md eq. 17): a material model, damping, or compliance of a kind in use.
bool compliant(const Material& material);
/// The name of a kind in use whose constraints have no force, because its k is below 1 or it has no compliance.
std::optional<std::string> kind_without_force(const Material& material);
/// Whether the bodies are held by forces alone, as modes explicit and newton need it.
bool has_forces(const Settings& settings);
/// Whether what is deformed too far keeps its shape.
bool yields(const Material& material);
/// Whether constraints resist their rate.
bool damped(const Material& material);
/// Whether bodies of this material move as rigid ones (method.md, "Hard bodies are rigid"): the kinds in use keep a
/// shape and all have k = 1.
bool moves_rigidly(const Settings& settings, const Material& material);
/// Whether any body of the scene does.
bool any_moves_rigidly(const Settings& settings);
/// Whether all kinds in use have k = 1 and none has compliance. With stretch among them, the exact solution is then the
/// motion of a rigid body.
bool hard(const Material& material);
/// The kinds in use, separated by commas: those of the material model, else `constraints`.
std::string kinds_in_use(const Material& material);
/// Whether its tets are smoothed, in modes that have them.
inline bool smoothed(const Material& material) {
  return material.material == "neo-hookean" && material.element == "smoothed";
}
/// s of smoothed tets: as it was given, or by Poisson's ratio (method.md, "Smoothed tets").
double smoothing_of(const Material& material);
/// The material as the settings' mode solves it: of linear tets where the mode has no smoothed ones.
Material in_mode(Material material, const Settings& settings);
bool uses(const Material& material, const ConstraintKind& kind);  ///< whether the kind is in use

/// Throws Error for values out of range and for settings that exclude each other; `where` names the file or flag, or
/// the body is named, by number where there are no names.
void check_settings(const Settings& settings, const std::string& where, const std::vector<std::string>& names = {});
/// The parts of a text between separators; empty ones are left out.
std::vector<std::string> split(const std::string& text, char separator);

}  // namespace tetpbd
