#include "app/options.h"

#include <sstream>

#include "sim/error.h"
#include "sim/model/material.h"
#include "sim/solvers/solver.h"

namespace tetpbd {

std::array<int, 2> two_numbers(const std::string& flag, const std::string& text, char between, int low, int high) {
  std::istringstream in(text);
  int first = 0, second = 0;
  char found = 0;
  in >> first >> found >> second;
  if (!in || !in.eof() || found != between || std::min(first, second) < low || std::max(first, second) > high)
    throw Error(fmt::format("bad {} '{}'", flag, text), "command line",
                fmt::format("give two whole numbers from {} to {} with {} between", low, high, between));
  return {first, second};
}

void add_gpu(CLI::App& command, int& gpu) {
  add(command, "--gpu", gpu, 0, 1023, "which device of tetpbd info (default: the first GPU)");
}

void add_progress(CLI::App& command, bool& progress) {
  command.add_flag("--progress", progress, "show progress even if standard error is no terminal");
}

CLI::Option* add_sizes(CLI::App& command, const char* flag, std::vector<std::array<int, 2>>& sizes,
                       const std::string& help) {
  const auto take = [&sizes](const std::vector<std::string>& texts) {
    sizes.clear();
    for (const std::string& text : texts) sizes.push_back(two_numbers("--size", text, 'x', 16, 16384));
  };
  return command.add_option_function<std::vector<std::string>>(flag, take, help)
      ->delimiter(',')
      ->default_str("1280x720");
}

void add_samples(CLI::App& command, int& samples) {
  command.add_option("--samples", samples, "of MSAA: 0, 2, 4, 8")
      ->check(one_of(std::array{"0", "2", "4", "8"}))
      ->capture_default_str();
}

void add_fill(CLI::App& command, SceneOverrides& overrides) {
  add(command, "--tetgen", overrides.tetgen, "TetGen switches, pY for the paper's kind of mesh");
  command
      .add_option("--fill", overrides.fill,
                  "how surfaces are tetrahedralized: tetgen, lattice; file: keep the file's tets (default: whichever "
                  "suits the surface)")
      ->check([](const std::string& text) {
        const bool known = std::ranges::find(fill_kinds, text) != std::end(fill_kinds);
        return known ? std::string() : fmt::format("must be one of {}, not '{}'", fmt::join(fill_kinds, ", "), text);
      });
  add(command, "--tets", overrides.tets, 10.0, 1e8, "approximate number of tets of a lattice (default: 15000)");
  add(command, "--spacing", overrides.spacing, 1e-9, 1e6, "m, cell size of a lattice, in place of --tets");
}

void add_up(CLI::App& command, std::string& up, const std::string& of) {
  CLI::Option* option = command.add_option("--up", up, "the up axis of " + of);
  option->check(one_of(std::array{"x", "y", "z"}))->type_name("AXIS");
  if (!up.empty()) option->capture_default_str();
}

void add_copies(CLI::App& command, SceneOverrides& overrides) {
  add(command, "--copies", overrides.copies, 1, 1000000,
      "simulate N copies of the bodies that do not interact: many runs in the dispatches of one");
}

void add_overrides(CLI::App& command, SceneOverrides& overrides) {
  add(command, "--mesh", overrides.mesh, "mesh in place of the scene's first body");
  add(command, "--height", overrides.height, 0.0, 1e6,
      "scale the first body to this height in m; 0: the file's own (default: the scene's)");
  add_up(command, overrides.up, "the first body's file (default: the scene's; for --mesh y)");
  add_fill(command, overrides);
  add_copies(command, overrides);
  command.add_option("--set", overrides.set, "PATH=VALUE for anything else in a scene, e.g. bodies.0.density=500")
      ->expected(1)
      ->take_all();
}

void add_parameters(CLI::App& command, SceneOverrides& overrides) {
  for (const Parameter& row : parameters()) {
    if (command.get_option_no_throw(flag_name(row))) continue;
    const auto words = choices(row);
    std::string allowed = words.empty()
                              ? fmt::format(" [{:g} .. {:g}{}{}]", row.low, row.high, *row.unit ? " " : "", row.unit)
                              : fmt::format(": {}", fmt::join(words, ", "));
    if (row.name == "material") allowed += fmt::format("; or {}", fmt::join(preset_names(material_presets()), ", "));
    if (row.name == "mode") {
      allowed = ":";
      for (const SolverMode& mode : solver_modes()) allowed += fmt::format("\n{}: {}", mode.name, mode.help);
    }
    const auto set = [&](const std::string& text) { overrides.parameters.emplace_back(row.name, text); };
    command.add_option_function<std::string>(flag_name(row), set, row.help + allowed)
        ->group("Settings")
        ->type_name("VALUE");
  }
}

void add_vary(CLI::App& command, const std::string& help, const std::function<void(const std::string&)>& take) {
  command
      .add_option_function<std::vector<std::string>>(
          "--vary",
          [take](const std::vector<std::string>& texts) {
            for (const std::string& text : texts) take(text);
          },
          help + "; VALUES as in 1,2,5 or FROM:TO:COUNT")
      ->type_name("NAME=VALUES")
      ->expected(1)
      ->take_all();
}

void add_variation(CLI::App& command, const std::string& flags, const std::string& name, std::vector<Variation>& all,
                   const std::string& help) {
  const std::string flag = flags.substr(0, flags.find(','));
  const auto take = [=, &all](const std::vector<std::string>& words) {
    vary(all, parse_variation(fmt::format("{}={}", name, fmt::join(words, ",")), flag));
  };
  CLI::Option* option = command.add_option_function<std::vector<std::string>>(flags, take, help);
  option->delimiter(',')->type_name("VALUES");
  if (const Variation* given = find_variation(all, name))
    option->default_str(fmt::format("[{}]", fmt::join(given->values, ",")));
}

void add_variations(CLI::App& command, std::vector<Variation>& all) {
  add_variation(command, "--modes,--mode", "mode", all,
                "solver modes; paper: the published pipeline (compare's default: those that suit the scene)");
  add_variation(command, "--iterations", "iterations", all, "iterations per substep");
  add_variation(command, "--substeps", "substeps", all, "substeps per step");
  add_variation(command, "--rigid-contact", "rigid_contact", all,
                "whether hard bodies in contact move as rigid ones (default: bench 0, as published; else the scene's)");
  add_variation(command, "--mass-splitting", "mass_splitting", all,
                "whether masses are split; else corrections are averaged (default: bench 0, as published; else the "
                "scene's)");
  add_variation(command, "--omegas", "omega", all, "over-relaxations (default: the scene's)");
  add_variation(command, "--elements", "element", all, "tet elements: linear, smoothed (default: the scene's)");
  add_variation(command, "--constraint-sets", "constraints", all, "sets of constraint kinds joined by +");
  add_vary(command, fmt::format("{}; once for each that varies", fmt::join(table_settings, ", ")),
           [&all](const std::string& text) {
             const Variation one = parse_variation(text, "--vary");
             if (std::ranges::find(table_settings, one.row->name) == table_settings.end())
               throw Error(
                   fmt::format("'{}' does not vary here", one.row->name), "--vary " + text,
                   fmt::format("give one of {}; tetpbd map varies any two settings", fmt::join(table_settings, ", ")));
             vary(all, one);
           });
}

void open_scene(Arguments& a) {
  a.run.size = a.sizes[0];
  a.soak.gpu = a.run.gpu;
  const ColourScale& scale = a.run.view.scale();
  if (const double end = a.run.range / scale.factor; end > 0)
    a.run.view.range() = {scale.is_signed ? -end : 0, end}, a.run.view.hold_range = true;
  if (!a.run.replay.empty()) return;
  a.opened = load_scene(a.scene, a.overrides);
  std::vector<std::string> modes;
  if (a.opened->mode_open && any_material(a.opened->settings, compliant))
    modes = {"explicit", "newton"};  // what it may be
  if (a.run.lanes.empty()) note_unused(a.opened->settings, modes, a.overrides);
}

// Options that mean the same in every command that opens a scene. Where nobody says the mode, the device may.
void add_scene(CLI::App& command, Arguments& a, bool by_device) {
  add(command, "--scene,--scenes", a.scene, fmt::format("a scene file, or one of {}", fmt::join(scene_names(), ", ")));
  add_overrides(command, a.overrides);
  command.add_option("--deform", a.overrides.deform,
                     "start shape: none, flatten, line, point, random, mirror, stretch:F, squash:F, "
                     "twist:DEGREES, jitter:F, invert-one, coincident, fold");
  add_parameters(command, a.overrides);
  std::string solvers;
  for (const Preset& preset : solver_presets()) solvers += fmt::format("{} ({}), ", preset.name, preset.help);
  add(command, "--solver", a.overrides.solver,
      "solver preset; further settings override it: " + solvers +
          "auto (tries solvers and takes the most accurate within --budget-ms)")
      ->type_name("NAME");
  add(command, "--budget-ms", a.overrides.budget_ms, 1e-6, 1e6,
      "GPU ms per step, for --solver auto (default: a tenth of dt)");
  add_gpu(command, a.run.gpu);
  command.add_flag("--explain", a.explain,
                   "print what the scene allocates and dispatches after --steps steps (default: 3), and stop");
  add_sizes(command, "--size", a.sizes, "of images and window, WxH from 16x16 to 16384x16384")->expected(1);
  add_samples(command, a.run.samples);
  CLI::App& view = *command.add_option_group("View");
  ViewOptions& look = a.run.view;
  view.add_option("--look", look.look, fmt::format("{}", fmt::join(look_names, ", ")))->transform(one_of(look_names));
  view.add_option("--colour", look.colour, fmt::format("{}", fmt::join(colour_names, ", ")))
      ->transform(one_of(colour_names));
  add(view, "--range", a.run.range, 1e-12, 1e12, "end of the colour scale, in its unit (default: from the values)");
  add(view, "--cut", look.cut, 0.0, 1.0, "cut the body open: show only this fraction of it along the axis");
  add(view, "--cut-axis", look.cut_axis, 0, 2, "0: x, 1: y, 2: z");
  view.add_flag("!--flat", look.smooth_normals, "flat normals");
  view.add_flag("!--no-shadow", look.shadow, "no shadow");
  view.add_flag("!--no-grid", look.grid, "no grid on the ground");
  view.add_flag("!--no-legend", look.legend, "no colour bar");
  view.add_flag("--contacts", look.contacts, "dots and arrows at contacts");
  view.add_flag("--arrows", look.arrows, "arrows of velocities");
  view.add_flag("--follow", look.follow,
                "the camera follows the bodies (in the window from the start, else once they would leave the picture)");
  view.add_flag_callback(
      "--plain", [&] { look = plain_view(look); }, "the cheapest picture: flat shading on a plain background");
  command.parse_complete_callback([&a, &command, by_device] {
    a.overrides.by_device = by_device;
    if (command.get_name() == "view" && command.count("--scene") == 0 && a.overrides.mesh.empty())
      a.scene = first_of_window;
    open_scene(a);
  });
}

}  // namespace tetpbd
