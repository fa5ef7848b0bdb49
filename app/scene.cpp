#include "app/scene.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdlib>

#include "app/bodies.h"
#include "app/files.h"
#include "app/lab/auto_solver.h"
#include "app/lab/progress.h"
#include "app/lab/vary.h"
#include "app/scene_file.h"
#include "sim/error.h"
#include "sim/model/did_you_mean.h"
#include "sim/model/material.h"
#include "sim/solvers/solver.h"

namespace tetpbd {

namespace fs = std::filesystem;
using nlohmann::json;

fs::path models_folder() {
  if (const char* folder = std::getenv("TETPBD_MODELS")) return folder;
  std::error_code error;
  const fs::path program = fs::read_symlink("/proc/self/exe", error);
  if (!error) {
    const fs::path installed = program.parent_path().parent_path() / "share/tetpbd/models";
    if (fs::is_directory(installed, error)) return installed;
  }
  return TETPBD_SOURCE_MODELS;
}

namespace {

// "bodies.0.density=500": the value is JSON, or text where it is none.
void set_path(json& document, const std::string& assignment) {
  const std::size_t equals = assignment.find('=');
  if (equals == std::string::npos || equals == 0)
    throw Error("bad assignment", "--set " + assignment, "write PATH=VALUE, as in bodies.0.density=500");
  json value = assignment.substr(equals + 1);
  if (json::accept(value.get<std::string>())) value = parse_json(value.get<std::string>());
  const std::vector<std::string> parts = split(assignment.substr(0, equals), '.');
  check_depth(parts.size());
  json* at = &document;
  try {
    for (const std::string& part : parts) at = at->is_array() ? &at->at(json::json_pointer("/" + part)) : &(*at)[part];
  } catch (const json::exception& problem) {
    throw Error("no such place in the scene", "--set " + assignment, message_of(problem));
  }
  *at = std::move(value);
}

// Whether it names a setting as flags and lanes do, in place of where the scene says it. Throws Error for a word that
// is neither that nor a key of scenes.
bool names_setting(const std::string& assignment) {
  const std::string name = assignment.substr(0, assignment.find('='));
  if (find_parameter(name)) return true;
  if (name.find('.') == std::string::npos && !scene_schema().contains(name) && !name.empty() &&
      name.size() < assignment.size())
    refuse_name(name, "--set " + assignment, keys(scene_schema()));
  return is_setting_of_body(name) && !scene_schema()["bodies"]["each"].contains(split(name, '.')[2]);
}

bool names_mode(const std::string& assignment) { return assignment.starts_with("solver.mode="); }

// As the flag does: iterations and substeps of the file were meant for a mode of its own kind.
void set_mode_in(json& document, const std::string& assignment) {
  const auto mode = [&] {
    const json* said = &document;
    for (const char* key : {"solver", "mode"})
      if (said->is_object() && said->contains(key)) said = &(*said)[key];
    const SolverMode* found = said->is_string() ? find_solver_mode(said->get<std::string>()) : nullptr;
    return found ? found : find_solver_mode(Settings().mode);
  };
  const SolverMode* before = mode();
  set_path(document, assignment);
  if (before->solves_like(*mode()) || !document.is_object() || !document["solver"].is_object()) return;
  document["solver"].erase("iterations"), document["solver"].erase("substeps");
}

// Puts a named solver's settings in place; whether it is auto, which chooses them later.
bool apply_solver(Settings& settings, const SceneOverrides& overrides) {
  const std::string name = overrides.solver.empty() && overrides.budget_ms ? "auto" : overrides.solver;
  if (name == "auto") {
    for (const auto& [parameter, text] : overrides.parameters)
      for (const char* chosen : {"mode", "iterations", "substeps", "omega"})
        if (parameter == chosen)
          throw Error(fmt::format("--solver auto chooses {} itself", chosen), flag_name(*find_parameter(parameter)),
                      "leave out one of the two");
    return true;
  }
  if (overrides.budget_ms)
    throw Error("a budget is for --solver auto", fmt::format("--solver {} --budget-ms", name),
                "leave out one of the two");
  if (!name.empty() && !apply_preset(settings, solver_presets(), name))
    throw Error("no such solver", "--solver " + name,
                did_you_mean(name, preset_names(solver_presets())) +
                    fmt::format("choose from auto, {}", fmt::join(preset_names(solver_presets()), ", ")));
  return false;
}

// A name among the shipped scenes, or a file. Throws Error that names the nearest.
fs::path find_scene(const std::string& name_or_file) {
  fs::path file = name_or_file;
  std::error_code error;
  if (!fs::is_regular_file(file, error) && file.extension() != ".json")
    file = models_folder() / "scenes" / (name_or_file + ".json");
  if (fs::is_regular_file(file, error)) return file;
  // Names with a folder, such as hard/line, are compared with those of that folder.
  fs::path folder = fs::path(name_or_file).parent_path();
  std::vector<std::string> names = scene_names(("scenes" / folder.relative_path()).string());
  if (folder.is_absolute() || names.empty()) folder.clear(), names = scene_names();
  for (std::string& name : names) name = (folder / name).string();
  throw Error(
      "no such scene", name_or_file,
      did_you_mean(name_or_file, names) + fmt::format("give a .json file or one of {} in {}", fmt::join(names, ", "),
                                                      (models_folder() / "scenes").string()));
}

// A solver's name first, then --set, then flags, which go on top.
void apply_settings_given(Scene& scene, const SceneOverrides& overrides) {
  const bool by_trying = apply_solver(scene.settings, overrides);
  for (const std::string& given : overrides.set)
    if (const std::size_t equals = given.find('='); names_setting(given))
      assign(scene.settings, given.substr(0, equals), given.substr(equals + 1), "--set " + given, scene.bodies.size());
  for (const auto& [name, text] : overrides.parameters)
    assign(scene.settings, name, text, flag_name(*find_parameter(name)));
  if (by_trying) scene.budget_ms = overrides.budget_ms.value_or(default_budget_ms(scene.settings));
}

// What nobody says, neither the scene nor the command line, the bodies decide.
void leave_open(Scene& scene, const json& document, const SceneOverrides& overrides) {
  const auto said = [&](const char* key) {
    return document.contains(json::json_pointer("/solver/" + std::string(key)));
  };
  const auto flag = [&](const char* key) {
    return std::ranges::any_of(overrides.parameters, [&](const auto& given) { return given.first == key; }) ||
           std::ranges::any_of(overrides.set, [&](const std::string& given) {
             return given.starts_with(fmt::format("solver.{}=", key)) || given.starts_with(fmt::format("{}=", key));
           });
  };
  const bool by_name = !overrides.solver.empty() || overrides.budget_ms;
  scene.mode_open = !flag("mode") && !flag("iterations") && !flag("substeps") && !by_name &&
                    (flag("material") || !(said("mode") || said("iterations") || said("substeps")));
  scene.by_device = overrides.by_device;
  const bool jacobi = flag("mode") || said("mode") || flag("omega") || flag("mass_splitting");
  scene.mode_open = scene.mode_open || (scene.by_device && !jacobi && !by_name && all_materials(scene.settings, hard));
  const bool says_contact = document.contains("/world/contact"_json_pointer) || flag("contact");
  if (!says_contact && scene.bodies.size() > 1) scene.settings.contact = "bodies";
}

void replace_mesh(Scene& scene, const SceneOverrides& overrides) {
  BodyDescription& body = scene.bodies[0];
  body.name = overrides.mesh.stem().string();
  body.mesh = overrides.mesh;
  body.surface.clear();
  body.up = "y";
  body.fill = "auto", body.tets.reset(), body.spacing.reset();
  body.block.reset(), body.tet.reset(), body.sheet.reset();
  scene.name = printable(fmt::format("{} with {}", scene.name, body.mesh.filename().string()));
  if (std::ranges::none_of(overrides.set, [](const auto& given) { return given.starts_with("camera"); }))
    scene.camera.reset();  // it was chosen for another body
}

void turn_up(BodyDescription& body, const std::string& up) {
  if (!is_axis(up)) throw Error("no such axis", "--up " + up, "choose from x, y, z");
  if (body.mesh.empty() && body.surface.empty())
    throw Error("the first body is from no file", "--up " + up, "name one by --mesh");
  body.up = up;
}

void change_bodies(Scene& scene, const SceneOverrides& overrides) {
  if (overrides.fill == "file" && std::ranges::none_of(scene.bodies, has_tets))
    throw Error("no body is from a file of tets", "--fill file", "leave it out, or name one by --mesh");
  for (BodyDescription& body : scene.bodies) {
    if (!overrides.tetgen.empty()) body.tetgen = overrides.tetgen;
    if (!overrides.fill.empty() && (overrides.fill != "file" || has_tets(body))) {
      body.fill = overrides.fill;
      if (body.fill != "lattice") body.tets.reset(), body.spacing.reset();  // of the scene's lattice
    }
    if (overrides.tets) body.tets = overrides.tets, body.spacing.reset();
    if (overrides.spacing) body.spacing = overrides.spacing, body.tets.reset();
    if (!overrides.deform.empty()) body.deform = overrides.deform;
  }
}

}  // namespace

std::vector<std::string> scene_names(const std::string& folder) {
  std::vector<std::string> names;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(models_folder() / folder, error))
    if (entry.path().extension() == ".json") names.push_back(entry.path().stem().string());
  std::sort(names.begin(), names.end());
  return names;
}

FillOptions fill_options(const std::string& by, const std::string& switches, const std::optional<double>& tets,
                         const std::optional<double>& spacing, const std::string& where) {
  if ((by == "tetgen" || by == "file") && (tets || spacing))
    throw Error(fmt::format("{} is of a lattice", tets ? "tets" : "spacing"), where,
                by == "file" ? "a file's tets stay as they are: leave out one of the two"
                             : "TetGen's switch a says how large tets are: leave out one of the two");
  if (tets && spacing)
    throw Error("tets and spacing both say how fine a lattice is", where, "leave out one of the two");
  return {.by = by == "auto" ? "" : by,
          .switches = switches,
          .size = {tets.value_or(LatticeSize().tets), spacing.value_or(0)},
          .sized = tets || spacing};
}

Scene load_scene(const std::string& name_or_file, const SceneOverrides& overrides) {
  const fs::path file = find_scene(name_or_file);
  json document = read_json(file, "scene");
  if (document.is_object() && document.contains("state_hash"))
    throw Error("these are the numbers of a run, not its scene", file.string(),
                fmt::format("give {}", (file.parent_path() / "scene.json").string()));
  for (const std::string& assignment : overrides.set)
    if (names_mode(assignment)) set_mode_in(document, assignment);
  for (const std::string& assignment : overrides.set)
    if (!names_mode(assignment) && !names_setting(assignment)) set_path(document, assignment);
  std::string where = file.string();
  if (!overrides.set.empty()) where += fmt::format(" with --set {}", fmt::join(overrides.set, " --set "));
  Scene scene = read_scene(document, where, file);
  apply_settings_given(scene, overrides);
  leave_open(scene, document, overrides);
  if (!overrides.mesh.empty()) replace_mesh(scene, overrides);
  if (!overrides.up.empty()) turn_up(scene.bodies[0], overrides.up);
  if (overrides.height) scene.bodies[0].height = *overrides.height;
  change_bodies(scene, overrides);
  if (overrides.copies > 1) make_copies(scene, overrides.copies);
  return scene;
}

void make_copies(Scene& scene, int copies) {
  const std::size_t bodies = scene.bodies.size(), attachments = scene.attachments.size(), forces = scene.forces.size(),
                    settings = scene.settings.bodies.size();
  const std::string where = fmt::format("--copies {}", copies);
  if (scene.settings.contact == "self" || (scene.settings.contact != "none" && bodies > 1))
    throw Error("copies stand in one place and would touch each other", where, "add --contact none");
  scene.settings.contact = "none";
  scene.copies = copies;
  for (int copy = 1; copy < copies; ++copy) {
    const std::size_t first = bodies * std::size_t(copy);
    for (std::size_t b = 0; b < bodies; ++b) {
      BodyDescription& body = scene.bodies.emplace_back(BodyDescription(scene.bodies[b]));
      body.name += fmt::format(" {}", copy + 1);
    }
    for (std::size_t b = 0; b < settings; ++b) scene.settings.bodies.push_back(BodySettings(scene.settings.bodies[b]));
    for (std::size_t a = 0; a < attachments; ++a) {
      AttachmentDescription& made = scene.attachments.emplace_back(AttachmentDescription(scene.attachments[a]));
      made.body += first, made.to += first;
    }
    for (std::size_t f = 0; f < forces; ++f)
      if (scene.forces[f].body) scene.forces.emplace_back(ForceDescription(scene.forces[f])).body.value() += first;
  }
}

std::string why_unused(const Settings& s, const std::string& name) {
  const auto is = [&](auto... names) { return ((name == names) || ...); };
  const SolverMode& mode = solver_mode(s);
  if (mode.leapfrog && is("iterations")) return "mode explicit has no iterations";
  if (!mode.leapfrog && is("stability", "mass_scaling")) return "it is of mode explicit";
  if (!mode.accelerates && is("acceleration")) return "it is of mode vbd";
  if (!mode.jacobi && is("omega", "mass_splitting")) return fmt::format("mode {} averages nothing", s.mode);
  if (is("mass_splitting") && any_material(s, compliant))
    return "with compliance or a material masses are always split";
  if (const Parameter& row = *find_parameter(name); is_of_material(row) && all_have_own_materials(s))
    return fmt::format("each body has a material of its own: change it by --set bodies.0.material.{}=VALUE",
                       row.name == "material" ? "model" : row.name);
  if (s.material == "none" && is("young_modulus", "poisson_ratio", "element")) return "there is no material";
  if (is("element") && s.material == "springs") return "springs have no tets";
  if (is("smoothing") && !smoothed(in_mode(s, s))) return "no tets are smoothed";
  if (s.material != "none" && (is("constraints") || name.starts_with("k_") || name.starts_with("compliance_")))
    return "the material stands in its place";
  for (const ConstraintKind& kind : constraint_kinds)
    if (is(std::string("k_") + kind.name, std::string("compliance_") + kind.name) && !uses(s, kind))
      return fmt::format("{} is not among the constraints", kind.name);
  if (is("ground_height") && !s.ground) return "there is no ground";
  if (is("contact_distance") && s.contact == "none") return "bodies do not touch each other";
  if (is("rigid_contact") && !any_material(s, hard)) return "the bodies are not hard";
  return {};
}

void note_unused(const Settings& settings, const std::vector<std::string>& modes, const SceneOverrides& overrides) {
  for (const std::string& mode : modes.empty() ? std::vector{settings.mode} : modes)
    if (const SolverMode* row = find_solver_mode(mode); row && any_material(settings, smoothed) && !row->smoothed)
      print_error(fmt::format("tetpbd: mode {} has no smoothed tets, and solves linear ones\n", mode));
  for (const auto& [name, text] : overrides.parameters) {
    const std::string key = find_parameter(name)->name;
    std::string why = why_unused(settings, key);
    for (const std::string& mode : modes) {
      Settings own = settings;
      own.mode = mode;
      if (why = find_solver_mode(mode) ? why_unused(own, key) : ""; why.empty()) break;
    }
    if (!why.empty())
      print_error(fmt::format("tetpbd: {} changes nothing: {}\n", flag_name(*find_parameter(key)), why));
  }
}

}  // namespace tetpbd
