#include "sim/settings.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <sstream>

#include "sim/constraints.h"
#include "sim/error.h"
#include "sim/solvers/handles.h"
#include "sim/solvers/solver.h"

namespace tetpbd {

const std::vector<Parameter>& parameters() {
  using S = Settings;
  using enum Effect;
  static const std::vector<Parameter> rows = {
      {"mode", "solver", &S::mode, 0, 0, false, "", "solver mode", rebuild},
      {"constraints", "solver", &S::constraints, 0, 0, false, "", "constraint kinds, separated by commas",
       rebuild},
      {"k_stretch", "solver", &S::k_stretch, 0, 1, false, "", "stiffness of stretch", live},
      {"k_bend", "solver", &S::k_bend, 0, 1, false, "", "stiffness of bending", live},
      {"k_volume", "solver", &S::k_volume, 0, 1, false, "", "stiffness of volume", live},
      {"compliance_stretch", "solver", &S::compliance_stretch, 0, 1, true, "m/N",
       "softness of edges, 1 over a spring's stiffness; 0: as hard as iterations make it. Any compliance or "
       "constraint_damping above 0 brings mass_splitting with it",
       live},
      {"compliance_bend", "solver", &S::compliance_bend, 0, 1e4, true, "rad^2/J",
       "softness of hinges; 0: as hard as iterations make it", live},
      {"compliance_volume", "solver", &S::compliance_volume, 0, 1, true, "m^3/Pa",
       "softness of tets' volumes, rest volume over bulk modulus; 0: as hard as iterations make it", live},
      {"constraint_damping", "solver", &S::constraint_damping, 0, 10, true, "s",
       "time over which constraints resist their rate: a spring's damping is this times its stiffness", live},
      {"omega", "solver", &S::omega, 0, 4, false, "",
       "over-relaxation of averaged corrections, 1 to 2 recommended (Jacobi modes)", live},
      {"mass_splitting", "solver", &S::mass_splitting, 0, 1, false, "",
       "masses shared out among a vertex's constraints: keeps momentum (modes node, constraint); "
       "with compliance always",
       live},
      {"handles", "solver", &S::handles, 0, 1, false, "",
       "how far rigid handles pull towards the rest shape in an iteration: for hard bodies, 0.4 to 0.8 "
       "(mode node, without compliance)",
       live},
      {"groups", "solver", &S::groups, 1, 128, true, "",
       "groups of constraints, solved one after the other (mode groups); many are a colouring", rebuild},
      {"iterations", "solver", &S::iterations, 0, 100000, true, "", "iterations a substep", live},
      {"substeps", "solver", &S::substeps, 1, 100000, true, "", "substeps a step", live},
      {"dt", "solver", &S::dt, 1e-6, 1, true, "s", "time of one step", live},
      {"damping", "solver", &S::damping, 0, 1000, false, "1/s",
       "rate at which velocity decays, exp(-damping t)", live},
      {"gravity", "world", &S::gravity, -1000, 1000, false, "m/s^2", "gravity, downwards", live},
      {"ground", "world", &S::ground, 0, 1, false, "", "whether there is a ground plane", live},
      {"ground_height", "world", &S::ground_height, -1e6, 1e6, false, "m", "height of the ground plane",
       live},
      {"friction", "world", &S::friction, 0, 10, false, "", "Coulomb friction of ground and obstacles", live},
      {"seed", "solver", &S::seed, 0, 2147483647, false, "", "seed of random start positions", restart},
  };
  return rows;
}

const Parameter* find_parameter(const std::string& name) {
  std::string key = name;
  std::replace(key.begin(), key.end(), '-', '_');
  for (const Parameter& row : parameters())
    if (key == row.name) return &row;
  return nullptr;
}

std::string flag_name(const Parameter& parameter) {
  std::string name = std::string("--") + parameter.name;
  std::replace(name.begin(), name.end(), '_', '-');
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
  if (std::string_view(parameter.name) == "mode")
    for (const SolverMode& mode : solver_modes()) names.push_back(mode.name);
  if (std::string_view(parameter.name) == "constraints")
    for (const ConstraintKind& kind : constraint_kinds()) names.push_back(kind.name);
  return names;
}

namespace {

[[noreturn]] void refuse(const Parameter& row, const std::string& value, const std::string& where,
                         const std::string& mend) {
  throw Error(fmt::format("'{}' cannot be {}", row.name, value.empty() ? "empty" : value), where, mend);
}

std::string range_text(const Parameter& row) {
  const char* kind = std::holds_alternative<int Settings::*>(row.member) ? "whole number" : "number";
  return fmt::format("give a {} from {:g} to {:g}{}{}", kind, row.low, row.high, *row.unit ? " " : "",
                     row.unit);
}

void check_words(const Parameter& row, const std::string& text, const std::string& where) {
  const auto allowed = choices(row);
  const bool list = std::string_view(row.name) == "constraints";
  const auto words = list ? split(text, ',') : std::vector<std::string>{text};
  for (const std::string& word : words)
    if (std::find(allowed.begin(), allowed.end(), word) == allowed.end())
      refuse(row, "'" + text + "'", where, fmt::format("choose from {}", fmt::join(allowed, ", ")));
  for (std::size_t i = 0; i < words.size(); ++i)
    if (std::count(words.begin(), words.end(), words[i]) > 1)
      refuse(row, "'" + text + "'", where, "name each once");
}

}  // namespace

void set_parameter(Settings& settings, const Parameter& row, const std::string& text,
                   const std::string& where) {
  const auto number = [&]<class T>(T& target) {
    T value{};
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(double(value)) ||
        double(value) < row.low || double(value) > row.high)
      refuse(row, text, where, range_text(row));
    target = value;
  };
  if (const auto* member = std::get_if<double Settings::*>(&row.member)) number(settings.**member);
  if (const auto* member = std::get_if<int Settings::*>(&row.member)) number(settings.**member);
  if (const auto* member = std::get_if<bool Settings::*>(&row.member)) {
    if (text != "true" && text != "false" && text != "1" && text != "0")
      refuse(row, text, where, "give true or false");
    settings.** member = text == "true" || text == "1";
  }
  if (const auto* member = std::get_if<std::string Settings::*>(&row.member)) {
    if (text.empty())
      refuse(row, text, where,
             std::string_view(row.name) == "constraints" ? "write none for no constraints" : "name one");
    const std::string value = text == "none" && std::string_view(row.name) == "constraints" ? "" : text;
    check_words(row, value, where);
    settings.** member = value;
  }
}

std::string parameter_text(const Settings& settings, const Parameter& row) {
  return std::visit(
      [&](auto member) -> std::string {
        using T = std::remove_cvref_t<decltype(settings.*member)>;
        if constexpr (std::is_same_v<T, bool>)
          return settings.*member ? "true" : "false";
        else if constexpr (std::is_same_v<T, std::string>)
          return (settings.*member).empty() ? "none" : settings.*member;
        else
          return fmt::format("{}", settings.*member);
      },
      row.member);
}

constexpr double usual_handles = 0.4;

void set_mode(Settings& settings, const std::string& word, const std::string& where) {
  const std::string with = "node+handles";
  bool known = true;
  if (!word.starts_with(with)) {
    settings.mode = word;
    settings.handles = 0;
    known = find_solver_mode(word);
  } else {
    settings.mode = "node";
    settings.handles = usual_handles;
    if (word != with) {
      const char *begin = word.data() + with.size(), *end = word.data() + word.size();
      const auto [stop, error] = std::from_chars(begin + 1, end, settings.handles);
      known = *begin == '-' && error == std::errc() && stop == end && settings.handles > 0 &&
              settings.handles <= 1;
    }
  }
  if (known) return;
  std::vector<std::string> words = choices(*find_parameter("mode"));
  words.push_back(with);
  throw Error(fmt::format("'mode' cannot be '{}'", word), where,
              fmt::format("choose from {}", fmt::join(words, ", ")));
}

std::string mode_word(const Settings& settings) {
  if (!wants_handles(settings)) return settings.mode;
  return settings.mode + "+handles" +
         (settings.handles == usual_handles ? "" : fmt::format("-{:g}", settings.handles));
}

const std::vector<SolverPreset>& solver_presets() {
  static const std::vector<SolverPreset> rows = {
      {"paper",
       "25 iterations a step, averaged",
       {{"mode", "node"},
        {"iterations", "25"},
        {"substeps", "1"},
        {"omega", "1.5"},
        {"handles", "0"},
        {"mass_splitting", "false"}}},
      {"substeps",
       "20 substeps of 1 iteration",
       {{"mode", "node"}, {"iterations", "1"}, {"substeps", "20"}, {"omega", "1.5"}, {"handles", "0"}}},
      {"hard",
       "10 substeps of 1 iteration with rigid handles: the least error for hard bodies",
       {{"mode", "node"},
        {"iterations", "1"},
        {"substeps", "10"},
        {"omega", "1.5"},
        {"handles", fmt::format("{}", usual_handles)}}},
  };
  return rows;
}

void apply_preset(Settings& settings, const SolverPreset& preset) {
  for (const auto& [name, text] : preset.values)
    set_parameter(settings, *find_parameter(name), text, preset.name);
}

void check_settings(const Settings& settings, const std::string& where) {
  Settings copy = settings;
  for (const Parameter& row : parameters()) set_parameter(copy, row, parameter_text(settings, row), where);
}

}  // namespace tetpbd
