// What bodies have of their own (BodySettings): in scenes, in lists of words, and for the panel of one body.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>

#include "sim/model/settings.h"

namespace tetpbd {

/// The keys material, friction and restitution of a scene's bodies. A material that all have is the settings' own,
/// which flags and widgets change. Throws Error naming `file`.
void read_bodies_settings(const nlohmann::json& bodies, Settings& settings, const std::string& file);
/// Of one body, whose material has the settings' values where it says nothing. Throws Error naming `where` and `file`.
BodySettings read_body_settings(const nlohmann::json& body, const Settings& settings, const std::string& where,
                                const std::string& file);
/// The same keys; of a material only what has an effect.
nlohmann::ordered_json body_settings_json(const BodySettings& body);
/// A setting's value, as setting_text() reads it.
nlohmann::ordered_json setting_json(const Settings& settings, const Parameter& row);

/// Whether no body is of the settings' own material.
bool all_have_own_materials(const Settings& settings);
/// The number of one of `count` bodies from a text. Throws Error naming `where`.
std::size_t body_number(const std::string& text, std::size_t count, const std::string& where);

/// The settings as they are for one body: its material, friction and restitution in place of those of all.
Settings settings_for_body(Settings settings, std::optional<std::size_t> body);
/// `settings` changed in what `wanted`, once settings_for_body(), says otherwise, for `count` bodies.
Settings with_body_changed(const Settings& settings, const Settings& wanted, std::size_t body, std::size_t count);

}  // namespace tetpbd
