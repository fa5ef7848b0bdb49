#include "sim/model/settings.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <sstream>

#include "sim/error.h"
#include "sim/model/did_you_mean.h"
#include "sim/solvers/solver.h"

namespace tetpbd {

const std::vector<Parameter>& parameters() {
  using S = Settings;
  static const std::vector<Parameter> rows = [] {
    std::vector<Parameter> all = {
        {"mode", "solver", &S::mode,
         "solver: node for hard bodies on a GPU, explicit or newton for soft ones, cpu-fast without a GPU", 0, 0, "",
         false, Effect::rebuild},
        {"constraints", "solver", &S::constraints,
         "kinds of constraint, separated by commas: edge lengths (stretch), dihedral angles of the surface (bend; "
         "isobend: quadratic, for thin sheets), tet volumes (volume)",
         0, 0, "", false, Effect::rebuild},
    };
    for (std::size_t k = 0; k < kind_count; ++k)
      if (!constraint_kinds[k].of_material())
        all.push_back({std::string("k_") + constraint_kinds[k].name, "solver", KindMember{&S::stiffness, k},
                       fmt::format("PBD stiffness k of {}, the fraction of a correction applied per iteration: 1 is "
                                   "hard; below 1 the result depends on iterations and mesh",
                                   constraint_kinds[k].noun)});
    for (std::size_t k = 0; k < kind_count; ++k)
      if (!constraint_kinds[k].of_material())
        all.push_back({std::string("compliance_") + constraint_kinds[k].name, "solver", KindMember{&S::compliance, k},
                       fmt::format("XPBD compliance of {}, the inverse of a spring's stiffness; 0: as stiff as the "
                                   "iterations make it. Above 0 mass_splitting is on",
                                   constraint_kinds[k].noun),
                       0, constraint_kinds[k].most_compliance, constraint_kinds[k].compliance_unit, true});
    const std::vector<Parameter> others = {
        {"material", "solver", &S::material,
         "material model, in place of constraints, k and compliance: none; springs along edges and volumes; "
         "neo-hookean tets, also for large strains",
         0, 0, "", false, Effect::rebuild},
        {"young_modulus", "solver", &S::young_modulus, "Young's modulus: jelly 2e4, rubber 1e6, wood 1e10", 1, 1e12,
         "Pa", true, Effect::rebuild},
        {"poisson_ratio", "solver", &S::poisson_ratio,
         "Poisson's ratio, how much the material thins when it is stretched: near 0.5 it preserves volume; springs: at "
         "least 0.25",
         0, 0.499, "", false, Effect::rebuild},
        {"element", "solver", &S::element,
         "tets of a neo-hookean material: linear; or smoothed, which average strain around each vertex and so bend "
         "correctly on coarse meshes (modes explicit and newton; others use linear ones)",
         0, 0, "", false, Effect::rebuild},
        {"smoothing", "solver", &S::smoothing,
         "fraction of the shear stiffness that smoothed tets do not average: 1 is too stiff, below 0.3 spurious soft "
         "modes appear. auto: from Poisson's ratio",
         0.05, 1, "", false, Effect::rebuild, true},
        {"constraint_damping", "solver", &S::constraint_damping,
         "stiffness-proportional damping of constraints, which leaves free flight alone: a spring's damping is this "
         "times its stiffness; 0.001 is a little",
         0, 10, "s", true},
        {"viscosity", "solver", &S::viscosity,
         "shear viscosity of a neo-hookean material: honey 10, soft tissue 1 to 100", 0, 1e9, "Pa s", true,
         Effect::rebuild},
        {"bulk_viscosity", "solver", &S::bulk_viscosity,
         "bulk viscosity of a neo-hookean material, against changes of volume", 0, 1e9, "Pa s", true, Effect::rebuild},
        {"yield_strain", "solver", &S::yield_strain,
         "strain beyond which a neo-hookean material flows plastically and keeps its new shape: wet clay 0.02, wax "
         "0.05; 0: never",
         0, 10, "", true, Effect::rebuild},
        {"creep_time", "solver", &S::creep_time,
         "time constant with which strain beyond the yield strain flows away; 0: at once", 0, 1e6, "s", true,
         Effect::rebuild},
        {"omega", "solver", &S::omega,
         "over-relaxation in modes node and constraint: 1.5 converges fastest in most scenes, above 2 it may diverge; "
         "with compliance at most 2",
         0, 4},
        {"acceleration", "solver", &S::acceleration,
         "Chebyshev acceleration in mode vbd: estimated spectral radius of a sweep, 0 for none; 0.9 helps where sweeps "
         "converge slowly, too large a value diverges",
         0, 0.999},
        {"mass_splitting", "solver", &S::mass_splitting,
         "splits each vertex's mass among its constraints, which conserves momentum; off: corrections are averaged, as "
         "in the paper (modes node, constraint); with compliance always on"},
        {"iterations", "solver", &S::iterations,
         "solver iterations per substep; more substeps of one iteration are usually better. Mode newton: iterations of "
         "conjugate gradients, 2 to 32 as the material gets stiffer; vbd: sweeps. auto: 1, in newton 4, in vbd 20",
         0, 100000, "", true, Effect::live, true},
        {"substeps", "solver", &S::substeps,
         "substeps per step: more are more accurate and stiffer, and cost proportionally more. 5 for hard bodies, 20 "
         "to be safe. auto: 20, in newton 1, in vbd 4, in explicit as many as stability needs, which is also a lower "
         "bound there",
         1, 100000, "", true, Effect::live, true},
        {"stability", "solver", &S::stability,
         "length of a substep in mode explicit, as a fraction of the longest that is stable at rest: lower it if a "
         "strongly deformed body fails",
         0.01, 1},
        {"mass_scaling", "solver", &S::mass_scaling,
         "mass scaling in mode explicit: mass it may add where the mesh is stiffest, as a fraction of the body's, to "
         "allow longer substeps; not used where they would be less than 1.2 times as long",
         0, 0.01},
        {"dt", "solver", &S::dt, "time step; shorter steps are more accurate", 1e-6, 1, "s", true},
        {"damping", "solver", &S::damping,
         "damping of all motion, free fall included: velocity decays as exp(-damping t)", 0, 1000, "1/s"},
        {"gravity", "world", &S::gravity, "gravitational acceleration, downwards: 9.81 on Earth, 0 in space", -1000,
         1000, "m/s^2"},
        {"ground", "world", &S::ground, "whether there is a ground plane"},
        {"ground_height", "world", &S::ground_height, "height of the ground plane", -1e6, 1e6, "m"},
        {"contact", "world", &S::contact,
         "contact between bodies (bodies), also of a body with itself (self); none: they pass through each other", 0, 1,
         "", false, Effect::rebuild},
        {"contact_distance", "world", &S::contact_distance,
         "distance that surfaces in contact keep from each other. auto: 0.15 of the local edge length, for sheets at "
         "most their thickness",
         1e-6, 1, "m", true, Effect::rebuild, true},
        {"friction", "world", &S::friction,
         "coefficient of Coulomb friction of ground, obstacles and bodies: ice 0, wood 0.5, rubber 1", 0, 10},
        {"restitution", "world", &S::restitution,
         "coefficient of restitution of hard bodies (rigid_contact): speed after an impact over speed before"},
        {"rigid_contact", "solver", &S::rigid_contact,
         "hard bodies (all k 1, stretch among the constraints, no compliance) move as rigid bodies while in contact; "
         "off, as in the paper: they rebound by what the corrections add",
         0, 1, "", false, Effect::rebuild},
        {"seed", "solver", &S::seed, "seed of random start shapes and masses", 0, 2147483647, "", false,
         Effect::restart},
    };
    all.insert(all.end(), others.begin(), others.end());
    return all;
  }();
  return rows;
}

const Parameter* find_parameter(const std::string& name) {
  std::string key = name;
  std::ranges::replace(key, '-', '_');
  const auto row = std::ranges::find(parameters(), key, &Parameter::name);
  return row == parameters().end() ? nullptr : &*row;
}

std::string flag_name(const Parameter& parameter) {
  std::string name = "--" + parameter.name;
  std::ranges::replace(name, '_', '-');
  return name;
}

std::vector<std::string> split(const std::string& text, char separator) {
  std::vector<std::string> parts;
  std::istringstream stream(text);
  for (std::string part; std::getline(stream, part, separator);)
    if (!part.empty()) parts.push_back(part);
  return parts;
}

std::vector<std::string> choices(const Parameter& parameter) {
  std::vector<std::string> names;
  if (parameter.name == "mode")
    for (const SolverMode& mode : solver_modes()) names.push_back(mode.name);
  if (parameter.name == "constraints")
    for (const ConstraintKind& kind : constraint_kinds)
      if (!kind.of_material()) names.push_back(kind.name);
  if (parameter.name == "material") names = {"none", "springs", "neo-hookean"};
  if (parameter.name == "element") names = {"linear", "smoothed"};
  if (parameter.name == "contact") names = {"none", "bodies", "self"};
  return names;
}

namespace {

[[noreturn]] void refuse(const Parameter& row, const std::string& value, const std::string& where,
                         const std::string& hint) {
  throw Error(fmt::format("'{}' cannot be {}", row.name, value.empty() ? "empty" : value), where, hint);
}

std::string range_text(const Parameter& row) {
  const char* kind = std::holds_alternative<int Settings::*>(row.member) ? "whole number" : "number";
  return fmt::format("give a {} from {:g} to {:g}{}{}", kind, row.low, row.high, *row.unit ? " " : "", row.unit);
}

bool in_range(const Parameter& row, double value) {
  return std::isfinite(value) && value >= row.low && value <= row.high;
}

void check_words(const Parameter& row, const std::string& text, const std::string& where) {
  const auto allowed = choices(row);
  const bool list = row.name == "constraints";
  const auto words = list ? split(text, ',') : std::vector<std::string>{text};
  for (const std::string& word : words)
    if (std::ranges::find(allowed, word) == allowed.end())
      refuse(row, "'" + text + "'", where,
             did_you_mean(word, allowed) + fmt::format("choose from {}", fmt::join(allowed, ", ")));
  for (std::size_t i = 0; i < words.size(); ++i)
    if (std::ranges::count(words, words[i]) > 1) refuse(row, "'" + text + "'", where, "name each once");
}

}  // namespace

void set_parameter(Settings& settings, const Parameter& row, const std::string& text, const std::string& where) {
  with_value(settings, row, [&]<class T>(T& target) {
    if constexpr (std::is_same_v<T, bool>) {
      if (text != "true" && text != "false" && text != "1" && text != "0")
        refuse(row, text, where, "give true or false");
      target = text == "true" || text == "1";
    } else if constexpr (std::is_same_v<T, std::string>) {
      const bool list = row.name == "constraints";
      if (text.empty()) refuse(row, text, where, list ? "write none for no constraints" : "name one");
      const std::string value = text == "none" && list ? "" : text;
      check_words(row, value, where);
      if (row.name == "mode")
        set_mode(settings, value, where);
      else
        target = value;
    } else {
      if (row.automatic && text == "auto") {
        target = T(automatic);
        return;
      }
      T value{};
      const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
      if (error != std::errc() || end != text.data() + text.size() || !in_range(row, double(value)))
        refuse(row, text, where, range_text(row));
      target = value;
    }
  });
}

std::string parameter_text(const Settings& settings, const Parameter& row) {
  return with_value(settings, row, [&]<class T>(const T& value) -> std::string {
    if constexpr (std::is_same_v<T, bool>)
      return value ? "true" : "false";
    else if constexpr (std::is_same_v<T, std::string>)
      return value.empty() ? "none" : value;
    else
      return row.automatic && value == T(automatic) ? "auto" : fmt::format("{}", value);
  });
}

bool is_of_material(const Parameter& row) {
  const Settings settings;
  const auto* begin = reinterpret_cast<const std::byte*>(static_cast<const Material*>(&settings));
  const auto* at = with_value(settings, row, [](const auto& v) { return reinterpret_cast<const std::byte*>(&v); });
  return at >= begin && at < begin + sizeof(Material);
}

void set_mode(Settings& settings, const std::string& word, const std::string& where) {
  if (!find_solver_mode(word)) check_words(*find_parameter("mode"), word, where);
  if (!solver_mode(settings).solves_like(*find_solver_mode(word))) settings.iterations = settings.substeps = automatic;
  settings.mode = word;
}

const std::vector<Preset>& solver_presets() {
  static const std::vector<Preset> rows = {
      {"paper", "25 iterations a step, averaged",
       "mode=node,iterations=25,substeps=1,omega=1.5,mass_splitting=false,rigid_contact=false"},
      {"hard", "5 substeps of 1 iteration, for bodies with k = 1",
       "mode=node,iterations=1,substeps=5,omega=1.5,mass_splitting=true,rigid_contact=true"},
      {"substeps", "20 substeps of 1 iteration",
       "mode=node,iterations=1,substeps=20,omega=1.5,mass_splitting=true,rigid_contact=true"},
      {"newton", "an implicit step of 4 iterations, for soft bodies", "mode=newton,iterations=4,substeps=1"},
  };
  return rows;
}

bool apply_preset(Settings& settings, const std::vector<Preset>& presets, const std::string& name) {
  const auto preset = std::ranges::find(presets, name, &Preset::name);
  if (preset == presets.end()) return false;
  for (const std::string& value : split(preset->values, ',')) {
    const std::size_t equals = value.find('=');
    set_parameter(settings, *find_parameter(value.substr(0, equals)), value.substr(equals + 1), name);
  }
  return true;
}

std::vector<std::string> preset_names(const std::vector<Preset>& presets) {
  std::vector<std::string> names;
  for (const Preset& preset : presets) names.emplace_back(preset.name);
  return names;
}

bool has_own_materials(const Settings& settings) {
  return std::ranges::any_of(settings.bodies, [](const BodySettings& body) { return body.material.has_value(); });
}

bool has_own_surfaces(const Settings& settings) {
  return std::ranges::any_of(settings.bodies,
                             [](const BodySettings& body) { return body.friction || body.restitution; });
}

namespace {

// Of each body, or the settings' own where none has anything of its own.
std::vector<const Material*> materials_in(const Settings& settings) {
  if (settings.bodies.empty()) return {&settings};
  std::vector<const Material*> all;
  for (std::size_t b = 0; b < settings.bodies.size(); ++b) all.push_back(&material_of(settings, b));
  return all;
}

}  // namespace

bool any_material(const Settings& settings, bool (*is_such)(const Material&)) {
  return std::ranges::any_of(materials_in(settings), [&](const Material* m) { return is_such(*m); });
}

bool all_materials(const Settings& settings, bool (*is_such)(const Material&)) {
  return std::ranges::all_of(materials_in(settings), [&](const Material* m) { return is_such(*m); });
}

double most_damping(const Settings& settings) {
  double most = 0;
  for (const Material* m : materials_in(settings)) {
    most = std::max(most, m->constraint_damping);
    if (damped(*m)) most = std::max(most, std::max(m->viscosity, m->bulk_viscosity) / m->young_modulus);
  }
  return most;
}

static bool is_viscous(const Material& material) {
  return material.material == "neo-hookean" && (material.viscosity > 0 || material.bulk_viscosity > 0);
}

bool yields(const Material& material) { return material.yield_strain > 0; }

bool damped(const Material& material) { return material.constraint_damping > 0 || is_viscous(material); }

std::string kinds_in_use(const Material& material) {
  if (material.material == "springs") return "stretch,volume";
  if (material.material == "none") return material.constraints;
  return std::string(smoothed(material) ? "smoothed" : "neo_hookean") +
         (material.constraint_damping > 0 ? ",dashpot" : "") + (is_viscous(material) ? ",viscous" : "");
}

// Within 2.5 % of ten-node tets on a bunny, an armadillo and a cantilever of mirrored cells, for ratios from 0.2 to
// 0.495; the best constant is 3.8 % off.
double smoothing_of(const Material& material) {
  const double by_ratio = std::min(0.45, 0.30 + 0.55 * (1 - 2 * material.poisson_ratio));
  return material.smoothing == automatic ? by_ratio : material.smoothing;
}

Material in_mode(Material material, const Settings& settings) {
  if (!solver_mode(settings).smoothed) material.element = "linear";
  return material;
}

bool uses(const Material& material, const ConstraintKind& kind) {
  const auto names = split(kinds_in_use(material), ',');
  return std::ranges::find(names, kind.name) != names.end();
}

bool moves_rigidly(const Settings& settings, const Material& material) {
  return settings.rigid_contact && hard(material) && uses(material, Stretch::row) && !solver_mode(settings).published;
}

bool has_forces(const Settings& settings) {
  return any_material(settings, compliant) &&
         !any_material(settings, [](const Material& m) { return kind_without_force(m).has_value(); });
}

bool any_moves_rigidly(const Settings& settings) {
  return std::ranges::any_of(materials_in(settings), [&](const Material* m) { return moves_rigidly(settings, *m); });
}

bool hard(const Material& material) {
  bool all = !compliant(material);
  for (std::size_t k = 0; k < kind_count; ++k)
    all = all && (material.stiffness[k] == 1 || !uses(material, constraint_kinds[k]));
  return all;
}

bool compliant(const Material& material) {
  bool any = damped(material) || material.material != "none";
  for (std::size_t k = 0; k < kind_count; ++k)
    any = any || (material.compliance[k] > 0 && uses(material, constraint_kinds[k]));
  return any;
}

std::optional<std::string> kind_without_force(const Material& material) {
  for (std::size_t k = 0; k < kind_count; ++k)
    if (material.material == "none" && uses(material, constraint_kinds[k]) &&
        !(material.compliance[k] > 0 && material.stiffness[k] == 1))
      return constraint_kinds[k].name;
  return std::nullopt;
}

namespace {

// With one material for all bodies.
void check_material(const Settings& settings, const std::string& where) {
  for (const Parameter& row : parameters())
    with_value(settings, row, [&]<class T>(const T& value) {
      if constexpr (std::is_same_v<T, std::string>) {
        if (row.name != "mode" || !find_solver_mode(value)) check_words(row, value, where);
      } else if (!in_range(row, double(value)) && !(row.automatic && value == T(automatic)))
        refuse(row, parameter_text(settings, row), where, range_text(row));
    });
  const SolverMode& mode = *find_solver_mode(settings.mode);
  if (compliant(settings) && !mode.compliance)
    throw Error(fmt::format("mode {} has no compliance", mode.name), where,
                "set compliance and constraint_damping to 0 or use another mode");
  for (const ConstraintKind& kind : constraint_kinds)
    if (kind.values > 1 && uses(settings, kind) && !mode.compliance)
      throw Error(fmt::format("mode {} has no {}", mode.name, kind.name), where,
                  "leave it out of constraints or use another mode");
  if (mode.forces)
    if (const auto kind = kind_without_force(settings))
      throw Error(fmt::format("mode {} needs forces, and {} has none", mode.name, *kind), where,
                  fmt::format("give a material, or compliance_{0} and k_{0} 1, or use another mode", *kind));
  if (settings.contact != "none" && !mode.pairs)
    throw Error(fmt::format("in mode {} bodies do not touch each other", mode.name), where,
                "set contact to none or use another mode");
  if (settings.material == "springs" && settings.poisson_ratio < 0.25)
    throw Error(fmt::format("springs have no Poisson's ratio of {:g}", settings.poisson_ratio), where,
                "give 0.25 or more, or material neo-hookean");
  if (yields(settings) && (settings.material != "neo-hookean" || smoothed(settings)))
    throw Error("a yield strain is of linear neo-hookean tets", where,
                "give material neo-hookean and element linear, or set yield_strain to 0");
  if (settings.restitution > 0 && !moves_rigidly(settings, settings))
    throw Error("restitution is of hard bodies", where,
                "set it to 0, or rigid_contact to true and all k to 1, without compliance or material");
  if (compliant(settings) && settings.omega > 2)
    throw Error(fmt::format("'omega' cannot be {:g} with compliance", settings.omega), where,
                "give at most 2: beyond it corrections grow");
}

}  // namespace

void check_settings(const Settings& settings, const std::string& where, const std::vector<std::string>& names) {
  if (settings.bodies.empty()) return check_material(settings, where);
  const bool differ = has_own_materials(settings), any_rigid = any_moves_rigidly(settings);
  Settings own = settings;  // of one body after the other
  own.bodies.clear();
  for (std::size_t b = 0; b < settings.bodies.size(); ++b) {
    const BodySettings& body = settings.bodies[b];
    const std::string name = names.empty() ? fmt::format("number {}", b) : names[b];
    const std::string place = differ || body.restitution ? fmt::format("body {}", name) : where;
    if (differ && solver_mode(settings).published)
      throw Error(fmt::format("mode {} has one material for all bodies", settings.mode), place,
                  "use mode node or constraint");
    static_cast<Material&>(own) = material_of(settings, b);
    // The world's restitution is of those bodies that are hard.
    own.restitution = body.restitution.value_or(any_rigid ? 0 : settings.restitution);
    own.friction = friction_of(settings, b);
    check_material(own, place);
    if (!body.regions.empty() && (own.material == "none" || smoothed(own)))
      throw Error(own.material == "none" ? "regions have moduli of a material, and the body has none"
                                         : "smoothed tets are of one material, and the body has regions",
                  fmt::format("body {}", name),
                  own.material == "none" ? "give it one, or leave out its regions" : "make its element linear");
    if (!body.regions.empty() && yields(own))
      throw Error("a body that yields is of one material, and this one has regions", fmt::format("body {}", name),
                  "leave out its regions, or set yield_strain to 0");
    for (const RegionModuli& region : body.regions) {
      Settings part = own;
      part.young_modulus = region.young_modulus.value_or(own.young_modulus);
      part.poisson_ratio = region.poisson_ratio.value_or(own.poisson_ratio);
      check_material(part, fmt::format("a region of body {}", name));
    }
  }
}

}  // namespace tetpbd
