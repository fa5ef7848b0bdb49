#include "app/bodies.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "app/scene.h"
#include "sim/error.h"
#include "sim/model/material.h"

namespace tetpbd {

using nlohmann::json, nlohmann::ordered_json;

namespace {

// By name, or what it says in place of the settings' material; a neo-Hookean one, unless it says how else bodies are
// held.
void read_material(const json& material, Settings& settings, const std::string& where, const std::string& file) {
  if (material.is_string()) {
    if (apply_preset(settings, material_presets(), material)) return;
    throw Error(fmt::format("'{}.material' is no material; there are {}", where,
                            fmt::join(preset_names(material_presets()), ", ")),
                file, "see docs/guide.md");
  }
  json rows = material;
  const auto is_of_kinds = [](const auto& item) {
    return item.key() == "constraints" || item.key().starts_with("k_") || item.key().starts_with("compliance_");
  };
  const auto items = rows.items();
  const bool by_kinds = std::any_of(items.begin(), items.end(), is_of_kinds);
  rows["material"] = rows.value("model", by_kinds ? "none" : "neo-hookean"), rows.erase("model");
  read_settings(rows, settings, fmt::format("'{}.material' of {}", where, file));
}

}  // namespace

BodySettings read_body_settings(const json& body, const Settings& settings, const std::string& where,
                                const std::string& file) {
  BodySettings own;
  if (body.contains("material")) {
    Settings with = settings;
    read_material(body["material"], with, where, file);
    own.material = with;
  }
  if (body.contains("friction")) own.friction = body["friction"].get<double>();
  if (body.contains("restitution")) own.restitution = body["restitution"].get<double>();
  for (const json& region : body.value("regions", json())) {
    RegionModuli& moduli = own.regions.emplace_back();
    if (region.contains("young_modulus")) moduli.young_modulus = region["young_modulus"].get<double>();
    if (region.contains("poisson_ratio")) moduli.poisson_ratio = region["poisson_ratio"].get<double>();
  }
  if (std::ranges::count(own.regions, RegionModuli()) == std::ssize(own.regions)) own.regions.clear();
  return own;
}

void read_bodies_settings(const json& bodies, Settings& settings, const std::string& file) {
  const json first = bodies[0].value("material", json());
  const bool alike = std::ranges::all_of(bodies, [&](const json& b) { return b.value("material", json()) == first; });
  if (alike && !first.is_null()) read_material(first, settings, "bodies.0", file);
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    settings.bodies.push_back(read_body_settings(bodies[b], settings, fmt::format("bodies.{}", b), file));
    if (alike) settings.bodies.back().material.reset();
  }
  if (std::ranges::count(settings.bodies, BodySettings()) == std::ssize(settings.bodies)) settings.bodies.clear();
}

ordered_json setting_json(const Settings& settings, const Parameter& row) {
  if (row.automatic && parameter_text(settings, row) == "auto") return "auto";
  if (row.name == "constraints") return split(settings.constraints, ',');
  return with_value(settings, row, [](const auto& value) { return ordered_json(value); });
}

ordered_json body_settings_json(const BodySettings& body) {
  ordered_json result = ordered_json::object();
  if (body.material) {
    Settings with;
    with.mode = "newton";  // which has all that a material can have
    static_cast<Material&>(with) = *body.material;
    for (const Parameter& row : parameters())
      if (is_of_material(row) && why_unused(with, row.name).empty())
        result["material"][row.name == "material" ? "model" : row.name] = setting_json(with, row);
  }
  for (const RegionModuli& region : body.regions) {
    ordered_json moduli = ordered_json::object();
    if (region.young_modulus) moduli["young_modulus"] = *region.young_modulus;
    if (region.poisson_ratio) moduli["poisson_ratio"] = *region.poisson_ratio;
    result["regions"].push_back(std::move(moduli));
  }
  if (body.friction) result["friction"] = *body.friction;
  if (body.restitution) result["restitution"] = *body.restitution;
  return result;
}

bool all_have_own_materials(const Settings& settings) {
  const auto has_own = [](const BodySettings& body) { return body.material.has_value(); };
  return !settings.bodies.empty() && std::ranges::all_of(settings.bodies, has_own);
}

std::size_t body_number(const std::string& text, std::size_t count, const std::string& where) {
  const bool number = !text.empty() && text.size() < 8 && text.find_first_not_of("0123456789") == std::string::npos;
  const std::size_t body = number ? std::stoul(text) : count;
  if (body >= count)
    throw Error(fmt::format("there is no body {}", text), where, fmt::format("count from 0 to {}", count - 1));
  return body;
}

Settings settings_for_body(Settings settings, std::optional<std::size_t> body) {
  if (!body) return settings;
  const Material own = material_of(settings, *body);
  settings.friction = friction_of(settings, *body), settings.restitution = restitution_of(settings, *body);
  static_cast<Material&>(settings) = own;
  return settings;
}

Settings with_body_changed(const Settings& settings, const Settings& wanted, std::size_t body, std::size_t count) {
  const Settings before = settings_for_body(settings, body);
  Settings result = wanted;
  static_cast<Material&>(result) = settings;
  result.friction = settings.friction, result.restitution = settings.restitution;
  result.bodies.resize(count);
  BodySettings& own = result.bodies[body];
  const Material &had = before, &has = wanted;
  if (!(has == had)) own.material = has;
  if (wanted.friction != before.friction) own.friction = wanted.friction;
  if (wanted.restitution != before.restitution) own.restitution = wanted.restitution;
  return result;
}

}  // namespace tetpbd
