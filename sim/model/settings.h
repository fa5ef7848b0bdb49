// Every number a user can set, each described once: the row gives the command-line flag, the scene key, the
// widget and the docs.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "sim/model/constraint_kinds.h"

namespace tetpbd {

/// Of a count that the mode decides: nothing was asked for.
inline constexpr int automatic = -1;

/// What surrounds all bodies, beside the obstacles of the model.
struct World {
  double gravity = 9.81;  ///< m/s^2, downwards
  bool ground = true;
  double ground_height = 0;      ///< m
  double friction = 0.5;         ///< where an obstacle has none of its own
  double restitution = 0;        ///< of hard bodies
  std::string contact = "none";  ///< of bodies with each other: none, bodies, self (pairs.h)
  bool operator==(const World&) const = default;
};

/// What a body is made of: a material model and its moduli, or kinds of constraint and their numbers.
struct Material {
  std::string material = "none";  ///< the model; else in place of kinds, stiffness and compliance (material.h)
  double young_modulus = 1e6;     ///< Pa
  double poisson_ratio = 0.3;
  double constraint_damping = 0;  ///< s
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
  double dt = 0.005;       ///< s
  double stability = 0.4;  ///< of mode explicit: a substep over the longest that is stable at rest
  double omega = 1.5;
  bool mass_splitting = true;
  double damping = 0;  ///< 1/s
  bool rigid_contact = true;
  int seed = 1;
  bool operator==(const SolverSettings&) const = default;
};

/// What was asked for, with one material for all bodies. Nothing but the user changes it; what a step takes
/// of it is a Plan.
struct Settings : World, Material, SolverSettings {
  bool operator==(const Settings&) const = default;
};

/// What a step takes: of `dt`, so many substeps of h seconds, each of so many iterations.
struct Plan {
  int substeps = 1, iterations = 1;
  double h = 0;  ///< s
  bool operator==(const Plan&) const = default;
};
/// What the mode makes of the settings before anything is known of the bodies: what was asked for, or its own
/// numbers where nothing was.
Plan plan_for(const Settings& settings);

/// Live: takes effect at the next step. Rebuild: the solver is made again, the state stays. Restart: the
/// scene starts anew.
enum class Effect { live, rebuild, restart };

/// Of an array by constraint kind.
struct KindMember {
  std::array<double, kind_count> Settings::*array;
  std::size_t kind;
};

struct Parameter {
  std::string name;     ///< scene key; the flag is --name with - for _
  const char* section;  ///< scene section: "solver" or "world"
  std::variant<double Settings::*, int Settings::*, bool Settings::*, std::string Settings::*, KindMember> member;
  std::string help;
  double low = 0, high = 1;  ///< allowed range; numbers only
  const char* unit = "";
  bool logarithmic = false;  ///< slider scale
  Effect effect = Effect::live;
  bool automatic = false;  ///< also takes the word auto: the mode decides
};
/// Calls f with a reference to the parameter's value in `settings`: double, int, bool or std::string.
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

/// Sets one value given as text; throws Error naming the key, `where` and the allowed values.
void set_parameter(Settings& settings, const Parameter& parameter, const std::string& text, const std::string& where);
/// Value as text, the way set_parameter reads it.
std::string parameter_text(const Settings& settings, const Parameter& parameter);
std::string flag_name(const Parameter& parameter);  ///< "--k-stretch"
/// The allowed values of a word-valued parameter ("mode"), empty for numbers; "constraints" takes a list of
/// them.
std::vector<std::string> choices(const Parameter& parameter);
/// Also the modes that are not offered elsewhere. Between corrections, leapfrog and implicit steps a number
/// of iterations or substeps means something else, so both become automatic. Throws Error naming `where` if
/// there is no such mode.
void set_mode(Settings& settings, const std::string& word, const std::string& where);

/// Settings by name: a way to solve (--solver), a material (material.h).
struct Preset {
  const char *name, *help;
  const char* values;  ///< PARAMETER=TEXT, separated by commas
};
const std::vector<Preset>& solver_presets();
/// Puts the one of that name in place; false if there is none.
bool apply_preset(Settings& settings, const std::vector<Preset>& presets, const std::string& name);
std::vector<std::string> preset_names(const std::vector<Preset>& presets);

/// Whether constraints are XPBD's (method.md eq. 25): there is a model or damping, or a kind in use has
/// compliance.
bool compliant(const Material& material);
/// A kind in use whose constraints have no force, but move as far as iterations do: k below 1, or no
/// compliance.
std::optional<std::string> kind_without_force(const Material& material);
/// Whether constraints resist their rate.
bool damped(const Material& material);
/// Whether touching bodies move as rigid ones (method.md, "Contact of a hard body"): the kinds in use hold a
/// shape, all with k = 1.
bool rigid_in_contact(const Settings& settings, const Material& material);
inline bool rigid_in_contact(const Settings& settings) { return rigid_in_contact(settings, settings); }
/// All kinds in use have k = 1 and nothing has compliance: the exact answer is a rigid body, if they include
/// stretch.
bool hard(const Material& material);
/// The kinds in use, as `constraints` lists them: the model's, if there is one.
std::string kinds_in_use(const Material& material);
bool uses(const Material& material, const ConstraintKind& kind);  ///< whether it is one of them

/// Throws Error for values out of range, and for those that do not go together; `where` names the file or
/// flag.
void check_settings(const Settings& settings, const std::string& where);
std::vector<std::string> split(const std::string& text, char separator);

}  // namespace tetpbd
