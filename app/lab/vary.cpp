#include "app/lab/vary.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

#include "app/bodies.h"
#include "sim/error.h"
#include "sim/model/did_you_mean.h"
#include "sim/model/material.h"
#include "sim/solvers/solver.h"

namespace tetpbd {

namespace {

// FROM:TO:COUNT as texts; whole numbers that fall together count once.
std::vector<std::string> spread_values(const Parameter& row, const std::vector<std::string>& range,
                                       const std::string& where, const char* remedy) {
  const auto number = [&](const std::string& word) { return to_number(word, where, remedy); };
  const double from = number(range[0]), to = number(range[1]), count = number(range[2]);
  const bool factors = row.logarithmic && from > 0 && to > 0;
  if (!(count >= 2 && count <= 100)) throw Error("bad number of values", where, "give 2 to 100");
  std::vector<std::string> values;
  for (int i = 0; i < int(count); ++i) {
    const double part = i / (std::floor(count) - 1);
    const double value = factors ? from * std::pow(to / from, part) : from + (to - from) * part;
    const bool whole = std::holds_alternative<int Settings::*>(row.member);
    const std::string word = whole ? fmt::format("{}", std::lround(value)) : fmt::format("{:.4g}", value);
    if (values.empty() || values.back() != word) values.push_back(word);
  }
  return values;
}

std::size_t rank(const Variation& variation) {
  const auto found = std::ranges::find(table_settings, variation.row->name);
  return found == table_settings.end() ? 0 : std::size_t(found - table_settings.begin()) + 1;
}

}  // namespace

double to_number(const std::string& text, const std::string& where, const char* remedy) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size())
    throw Error(fmt::format("'{}' is no number", text), where, remedy);
  return value;
}

void refuse_name(const std::string& name, const std::string& where, std::vector<std::string> known) {
  for (const Parameter& row : parameters()) known.push_back(row.name);
  throw Error(fmt::format("there is no setting '{}'", name), where,
              did_you_mean(name, known) + "docs/guide.md lists all settings");
}

bool is_setting_of_body(const std::string& name) {
  const std::vector<std::string> parts = split(name, '.');
  const Parameter* row = parts.size() == 3 && parts[0] == "bodies" ? find_parameter(parts[2]) : nullptr;
  return row && (is_of_material(*row) || row->name == "friction" || row->name == "restitution");
}

void assign(Settings& settings, const std::string& name, const std::string& text, const std::string& where,
            std::size_t bodies) {
  if (const Parameter* row = find_parameter(name)) {
    std::string value = text;
    if (row->name == "constraints") std::ranges::replace(value, '+', ',');
    if (row->name == "material" && apply_preset(settings, material_presets(), text)) return;
    return set_parameter(settings, *row, value, where);
  }
  if (!is_setting_of_body(name)) refuse_name(name, where);
  const std::vector<std::string> parts = split(name, '.');
  const std::size_t body = body_number(parts[1], bodies, where);
  Settings wanted = settings_for_body(settings, body);
  assign(wanted, parts[2], text, where);
  settings = with_body_changed(settings, wanted, body, bodies);
}

Variation parse_variation(const std::string& text, const std::string& flag) {
  const std::size_t equals = std::min(text.find('='), text.size());
  const std::string where = flag + " " + text, name = text.substr(0, equals);
  const Parameter* row = find_parameter(name);
  if (!row) refuse_name(name, where);
  if (row->effect == Effect::restart)
    throw Error(fmt::format("'{}' does not vary", row->name), where, "it makes other bodies: give it as a flag");
  const std::string words = text.substr(std::min(equals + 1, text.size()));
  const std::string remedy = fmt::format("write {0}=A,B or {0}=FROM:TO:COUNT", row->name);
  Variation variation{row, split(words, ','), flag};
  const bool number = !std::holds_alternative<std::string Settings::*>(row->member) &&
                      !std::holds_alternative<bool Settings::*>(row->member);
  if (const auto range = split(words, ':'); number && range.size() == 3)
    variation.values = spread_values(*row, range, where, remedy.c_str());
  if (variation.values.empty()) throw Error(fmt::format("'{}' has no values", row->name), where, remedy);
  if (row->name != "mode")
    for (Settings probe; const std::string& value : variation.values) assign(probe, row->name, value, where);
  return variation;
}

std::vector<Variation> parse_variations(const std::vector<std::string>& texts, const std::string& flag) {
  std::vector<Variation> all;
  for (const std::string& text : texts) vary(all, parse_variation(text, flag));
  return all;
}

void vary(std::vector<Variation>& all, const Variation& one) {
  std::erase_if(all, [&](const Variation& other) { return other.row == one.row; });
  all.insert(std::ranges::upper_bound(all, rank(one), {}, rank), one);
}

const Variation* find_variation(const std::vector<Variation>& all, const std::string& name) {
  const auto found = std::ranges::find(all, name, [](const Variation& one) { return one.row->name; });
  return found == all.end() ? nullptr : &*found;
}

std::vector<Settings> combine(const Settings& base, const std::vector<Variation>& variations) {
  std::vector<std::size_t> by_row(variations.size());
  for (std::size_t i = 0; i < by_row.size(); ++i) by_row[i] = i;
  std::ranges::sort(by_row, {}, [&](std::size_t i) { return variations[i].row; });  // the table begins with the mode
  std::size_t count = 1;
  for (const Variation& one : variations) count *= one.values.size();
  std::vector<Settings> all(count, base);
  for (std::size_t c = 0; c < count; ++c) {
    std::vector<std::size_t> chosen(variations.size());
    for (std::size_t i = variations.size(), rest = c; i-- > 0; rest /= variations[i].values.size())
      chosen[i] = rest % variations[i].values.size();
    for (const std::size_t i : by_row) {
      const auto& [row, values, flag] = variations[i];
      if (row->name == "mode")
        set_mode(all[c], values[chosen[i]], flag);  // also the one that only comparisons offer
      else
        assign(all[c], row->name, values[chosen[i]], flag);
    }
  }
  return all;
}

std::vector<Settings> without_repeats(const std::vector<Settings>& all) {
  std::vector<Settings> chosen;
  for (Settings settings : all) {
    const bool own_choice = solver_mode(settings).leapfrog;
    if (own_choice) settings.iterations = settings.substeps = automatic;
    if (!own_choice || std::ranges::find(chosen, settings) == chosen.end()) chosen.push_back(settings);
  }
  return chosen;
}

}  // namespace tetpbd
