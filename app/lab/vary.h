// The one grammar of settings that are set or vary: NAME=VALUE, NAME=A,B or NAME=FROM:TO:COUNT. It is that of --vary
// and of the lists of compare, bench and map, of flags, of the words of lanes and of --set.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "sim/model/settings.h"

namespace tetpbd {

/// A setting and the texts of its values.
struct Variation {
  const Parameter* row = nullptr;
  std::vector<std::string> values{};
  std::string flag{};  ///< that named it, for errors
};

/// What varies in tables of compare and bench, from what varies most slowly: how a scene is solved.
inline constexpr std::array table_settings{"constraints",    "mode",  "element",    "rigid_contact",
                                           "mass_splitting", "omega", "iterations", "substeps"};

/// "omega=0.5,1,1.5", "constraints=stretch,stretch+bend", or "young_modulus=1e4:1e7:7": evenly, or by equal factors
/// where the slider goes so. Throws Error naming `flag`, but not for words of mode, which may be those of baselines.
Variation parse_variation(const std::string& text, const std::string& flag);
std::vector<Variation> parse_variations(const std::vector<std::string>& texts, const std::string& flag = "default");
/// Puts it in the place of one of the same setting, or among the others in the order of table_settings.
void vary(std::vector<Variation>& all, const Variation& one);
const Variation* find_variation(const std::vector<Variation>& all, const std::string& name);

/// Every combination, the last variation varying fastest. In each, what decides the meaning of other settings is set
/// before these, whatever the order. Throws Error.
std::vector<Settings> combine(const Settings& base, const std::vector<Variation>& variations);
/// Without those that a mode which chooses iterations and substeps itself has in common.
std::vector<Settings> without_repeats(const std::vector<Settings>& all);

/// Sets "omega", "material" (a model or a preset), "constraints" (joined by , or +), or "bodies.1.young_modulus" of one
/// of so many bodies. Throws Error as set_parameter() does, where there is no such body, and for other names.
void assign(Settings& settings, const std::string& name, const std::string& text, const std::string& where,
            std::size_t bodies = 0);
/// Throws Error that suggests a setting, or another of the names that are known there.
[[noreturn]] void refuse_name(const std::string& name, const std::string& where, std::vector<std::string> known = {});
/// Whether it is a setting of one body, "bodies.1.young_modulus".
bool is_setting_of_body(const std::string& name);

/// Of a word on the command line; throws Error.
double to_number(const std::string& text, const std::string& where, const char* remedy);

}  // namespace tetpbd
