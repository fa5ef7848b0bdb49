// The command line: the options of each command, and what it starts.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <sstream>
#include <utility>

#include "app/commands.h"
#include "app/export.h"
#include "app/files.h"
#include "app/window/lanes.h"
#include "app/window/record.h"
#include "sim/error.h"
#include "sim/gl/gpu.h"
#include "sim/interrupt.h"
#include "sim/model/did_you_mean.h"
#include "sim/model/material.h"
#include "sim/solvers/solver.h"

using namespace tetpbd;

namespace {

constexpr long most_steps = 1000000000;
constexpr const char* first_of_window = "bunny";  // soft, and solved by PBD: its settings matter at sight

/// What words can set, with its defaults.
struct Arguments {
  int (*start)(const Arguments&) = nullptr;  ///< the command; none: the window
  std::string scene = "bunny-drop";
  SceneOverrides overrides;
  std::optional<Scene> opened;  ///< from these, by commands that take a scene
  std::vector<std::array<int, 2>> sizes{{1280, 720}};
  bool explain = false;
  RunOptions run;  ///< its device and picture are those of every command that opens a scene
  SoakOptions soak;
  ReferenceOptions reference;
  BenchOptions bench;
  CompareOptions compare;
  MapOptions map;
  bool varied = false;  ///< an axis of the map by --vary
  bool hard_cases = false;
  ReproduceOptions reproduce;
  MeshOptions mesh;
  bool selftest = false;
  std::vector<std::array<const CLI::Option*, 2>> apart;  ///< never together: one would be dropped
};

// ------------------------------------------------------------------------------------------------------------
// kinds of options

/// "1280x720", "2/8": two whole numbers in a range.
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

/// One of these words; as a transform() its number takes its place, which is an enum's value.
template <class Words>
CLI::Validator one_of(const Words& words) {
  return CLI::Validator(
      [=](std::string& text) {
        const auto found = std::ranges::find(words, text);
        if (found == words.end())
          return fmt::format("{}must be one of {}, not '{}'", did_you_mean(text, {words.begin(), words.end()}),
                             fmt::join(words, ", "), text);
        text = std::to_string(found - words.begin());
        return std::string();
      },
      "");
}

/// Text, a path, or a list. An empty one is refused: an unset shell variable would run another experiment.
template <class T>
CLI::Option* add(CLI::App& command, const char* flag, T& target, const std::string& help) {
  CLI::Option* option = command.add_option(flag, target, help);
  option->check([](const std::string& text) { return std::string(text.empty() ? "must not be empty" : ""); });
  if constexpr (!std::is_constructible_v<std::filesystem::path, T>) option->delimiter(',');
  return target.empty() ? option : option->capture_default_str();
}

/// A number in a range, or a list of them. A default outside the range is for the help to say.
template <class T, class N>
void add(CLI::App& command, const char* flag, T& target, N low, N high, const std::string& help) {
  CLI::Option* option = command.add_option(flag, target, help);
  const auto in_range = [=](const std::string& text) {
    N value{};
    if (CLI::detail::lexical_cast(text, value) && value >= low && value <= high) return std::string();
    return fmt::format("must be a {} from {} to {}, not '{}'", std::is_integral_v<N> ? "whole number" : "number", low,
                       high, text);
  };
  option->check(in_range, fmt::format("[{} .. {}]", low, high));
  bool shown = false;
  if constexpr (std::is_same_v<T, N>) shown = target >= low && target <= high;
  if constexpr (std::is_same_v<T, std::vector<N>>) option->delimiter(','), shown = !target.empty();
  if (shown) option->capture_default_str();
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

/// How surfaces become tets.
void add_fill(CLI::App& command, SceneOverrides& overrides) {
  add(command, "--tetgen", overrides.tetgen, "TetGen switches, pY for the paper's kind of mesh");
  command
      .add_option("--fill", overrides.fill,
                  "by what surfaces and boundaries of tets are filled: tetgen, lattice; file: tets stay as they are "
                  "(default: what suits them)")
      ->check([](const std::string& text) {
        const bool known = std::ranges::find(fill_kinds, text) != std::end(fill_kinds);
        return known ? std::string() : fmt::format("must be one of {}, not '{}'", fmt::join(fill_kinds, ", "), text);
      });
  add(command, "--tets", overrides.tets, 10.0, 1e8, "about so many, of a lattice (default: 15000)");
  add(command, "--spacing", overrides.spacing, 1e-9, 1e6, "m, of a lattice, in place of --tets");
}

void add_up(CLI::App& command, std::string& up, const std::string& of) {
  CLI::Option* option = command.add_option("--up", up, "the axis that points upwards in " + of);
  option->check(one_of(std::array{"x", "y", "z"}))->type_name("AXIS");
  if (!up.empty()) option->capture_default_str();
}

void add_overrides(CLI::App& command, SceneOverrides& overrides) {
  add(command, "--mesh", overrides.mesh, "mesh in place of the scene's first body");
  add(command, "--height", overrides.height, 0.0, 1e6,
      "m, of the first body; 0: as its file has it (default: the scene's)");
  add_up(command, overrides.up, "the first body's file (default: the scene's, of --mesh y)");
  add_fill(command, overrides);
  command.add_option("--set", overrides.set, "PATH=VALUE for anything else, as in bodies.0.density=500")
      ->expected(1)
      ->take_all();
}

/// A flag for every setting that the command has none of its own for.
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

/// --vary, given once for each setting.
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

/// A list for a setting that varies: --iterations 1,5 means --vary iterations=1,5.
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

/// What compare and bench vary, every combination of which is run. Anything else would make other scenes.
void add_variations(CLI::App& command, std::vector<Variation>& all) {
  add_variation(command, "--modes,--mode", "mode", all,
                "solver modes; paper: as published (default of compare: those that suit the scene)");
  add_variation(command, "--iterations", "iterations", all, "iterations a substep");
  add_variation(command, "--substeps", "substeps", all, "substeps a step");
  add_variation(command, "--rigid-contact", "rigid_contact", all,
                "whether touching hard bodies move as rigid ones (default: bench 0, as published; else the scene's)");
  add_variation(command, "--mass-splitting", "mass_splitting", all,
                "whether masses are split; else corrections are averaged (default: bench 0, as published; else the "
                "scene's)");
  add_variation(command, "--omegas", "omega", all, "over-relaxations (default: the scene's)");
  add_variation(command, "--elements", "element", all, "kinds of tets: linear, smoothed (default: the scene's)");
  add_variation(command, "--constraint-sets", "constraints", all, "sets of kinds joined by +");
  constexpr std::array known{"mode",           "constraints", "element",    "rigid_contact",
                             "mass_splitting", "omega",       "iterations", "substeps"};
  add_vary(command, fmt::format("{}; once for each that varies", fmt::join(known, ", ")),
           [=, &all](const std::string& text) {
             const Variation one = parse_variation(text, "--vary");
             if (std::ranges::find(known, one.row->name) == known.end())
               throw Error(fmt::format("'{}' does not vary here", one.row->name), "--vary " + text,
                           fmt::format("give one of {}; tetpbd map varies any two settings", fmt::join(known, ", ")));
             vary(all, one);
           });
}

// ------------------------------------------------------------------------------------------------------------
// commands

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
void add_scene(CLI::App& command, Arguments& a, bool by_device = false) {
  add(command, "--scene,--scenes", a.scene, fmt::format("a scene file, or one of {}", fmt::join(scene_names(), ", ")));
  add_overrides(command, a.overrides);
  command.add_option("--deform", a.overrides.deform,
                     "start shape: none, flatten, line, point, random, mirror, stretch:F, squash:F, "
                     "twist:DEGREES, jitter:F, invert-one, coincident, fold");
  add_parameters(command, a.overrides);
  std::string solvers;
  for (const Preset& preset : solver_presets()) solvers += fmt::format("{} ({}), ", preset.name, preset.help);
  add(command, "--solver", a.overrides.solver,
      "how to solve, by name; other settings go on top: " + solvers +
          "auto (tries, and takes what moves most nearly right within --budget-ms)")
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
  add(view, "--range", a.run.range, 1e-12, 1e12, "end of the colour scale, in its unit (default: as the values ask)");
  add(view, "--cut", look.cut, 0.0, 1.0, "shows what is below this part of the body alone");
  add(view, "--cut-axis", look.cut_axis, 0, 2, "0: x, 1: y, 2: z");
  view.add_flag("!--flat", look.smooth_normals, "flat normals");
  view.add_flag("!--no-shadow", look.shadow, "no shadow");
  view.add_flag("!--no-grid", look.grid, "no lines on the ground");
  view.add_flag("!--no-legend", look.legend, "no colour bar");
  view.add_flag("--contacts", look.contacts, "dots and arrows where something touches");
  view.add_flag("--arrows", look.arrows, "velocities");
  view.add_flag("--follow", look.follow,
                "the camera goes where the bodies go (the window: from the start; else only as they would "
                "leave the picture)");
  view.add_flag_callback(
      "--plain", [&] { look = plain_view(look); }, "the cheapest picture: flat faces on one colour");
  command.parse_complete_callback([&a, &command, by_device] {
    a.overrides.by_device = by_device;
    if (command.get_name() == "view" && command.count("--scene") == 0 && a.overrides.mesh.empty())
      a.scene = first_of_window;
    open_scene(a);
  });
}

int start_view(const Arguments& a) {
  if (!std::getenv("DISPLAY") && !std::getenv("WAYLAND_DISPLAY"))
    throw Error("no display", "DISPLAY and WAYLAND_DISPLAY are not set",
                "start it in a desktop session, or use tetpbd run");
  for (const std::string& words : a.run.lanes)
    lane_settings(a.opened->settings, words, "--lane " + words, nullptr, a.opened->bodies.size());
  return run_window(*a.opened, a.scene, a.overrides, a.run);
}

/// Each command is a paragraph: its help, what it starts, its options.
void add_commands(CLI::App& app, Arguments& a) {
  const auto command = [&](const char* name, const char* help, int (*start)(const Arguments&)) -> CLI::App& {
    CLI::App& added = *app.add_subcommand(name, help);
    added.final_callback([&a, start] { a.start = start; });
    return added;
  };

  CLI::App& view = command("view", "a window (the default where there is a display)", start_view);
  add_scene(view, a, true);
  view.add_option("--lane", a.run.lanes,
                  "solve the scene side by side in up to 4 ways: of each, solvers by name or "
                  "PARAMETER=VALUE, or budget_ms=MILLISECONDS for what auto chooses, separated by commas")
      ->type_name("WORDS")
      ->expected(1, int(most_lanes));
  add(view, "--history-mb", a.run.history_mb, 0L, 1000000L,
      "memory for states to go back to, on the GPU and of CPU modes; 0: none");
  add(view, "--record", a.run.record, "write what is done into this file, for tetpbd run --replay");

  CLI::App& run = command("run", "headless: steps a scene, writes frames, video, statistics", [](const Arguments& a) {
    return a.run.replay.empty() ? run_headless(*a.opened, a.run) : run_replay(a.run);
  });
  add_scene(run, a, true);
  add(run, "--steps", a.run.steps, 1L, most_steps, "steps to take (default: the scene's duration)");
  add(run, "--out", a.run.out, "folder for stats.json, stats.csv, frames");
  add(run, "--png-every", a.run.png_every, 1L, most_steps, "write frame_NNNNN.png every K steps");
  add(run, "--video", a.run.video, "write a video (.mp4 .mkv .webm .gif) through ffmpeg, in real time");
  add(run, "--video-every", a.run.video_every, 1L, most_steps, "steps per video frame (default: those of 1/30 s)");
  add(run, "--turntable", a.run.turntable, 1e-3, 1e9, "the camera turns about the bodies once in so many s");
  add(run, "--camera-path", a.run.camera_path,
      "a JSON list of cameras as in a scene, each with its \"time\" in s, which it goes through")
      ->excludes("--turntable", "--follow");
  add(run, "--csv-every", a.run.csv_every, 0L, most_steps, "a row of stats.csv every K steps, 0: none");
  add(run, "--reference", a.run.reference,
      "the reference motion, made by tetpbd reference (default: the cache's of this scene)");
  add(run, "--measure-every", a.run.measure_every, 1L, most_steps, "measure errors every K steps and at the end");
  run.add_flag("--positions", a.run.positions,
               "write positions, velocities, rest (positions), tets, faces and bodies (of vertices) as .npy");
  add(run, "--save-state", a.run.save_state, "write the end, with all that the next step depends on, into this file");
  add(run, "--from-state", a.run.from_state,
      "go on from there, for --steps further steps: with the same settings by the same bits");
  add(run, "--positions-every", a.run.positions_every, 1L, most_steps,
      "those, and positions every K steps in trajectory.npy");
  add(run, "--export", a.run.exports,
      "frames for other programs, vtk: ParaView; pc2: Blender's mesh cache with its OBJ; ply: surfaces; as "
      "often as --positions-every says (default: every 1/30 s)")
      ->check(one_of(export_formats));
  add(run, "--dump-shaders", a.run.dump_shaders,
      "folder for the text of each shader of the run as it is compiled, a file each");
  run.add_flag("--check-crossings", a.run.check_crossings,
               "after every step, test exactly whether surfaces cut each other: the first that do end the run with "
               "status 1");
  CLI::Option* replay = add(run, "--replay", a.run.replay,
                            "instead: what a record of tetpbd view --record says, lanes and all; with "
                            "--video, drawn at the speed it was played");
  for (const char* dropped : {"--save-state", "--from-state",     "--scene",     "--mesh",        "--tetgen",
                              "--set",        "--deform",         "--solver",    "--budget-ms",   "--explain",
                              "--steps",      "--png-every",      "--positions", "--video-every", "--csv-every",
                              "--reference",  "--measure-every",  "--turntable", "--camera-path", "--positions-every",
                              "--export",     "--height",         "--fill",      "--tets",        "--spacing",
                              "--up",         "--check-crossings"})
    a.apart.push_back({replay, run.get_option(dropped)});
  for (const Parameter& row : parameters()) a.apart.push_back({replay, run.get_option(flag_name(row))});
  run.add_flag("--strict", a.run.strict, "exit status 1 also where the verdict is doubtful");
  add_progress(run, a.run.progress);

  CLI::App& reference =
      command("reference", "finds the reference motion of a scene and keeps it: what runs are held against",
              [](const Arguments& a) { return run_reference(*a.opened, a.reference); });
  add_scene(reference, a);
  add(reference, "--steps", a.reference.steps, 1L, most_steps, "steps of the scene (default: its duration)");
  add(reference, "--method", a.reference.method,
      "leapfrog or implicit, for soft bodies (default: leapfrog, unless its steps are too short); ten-node: the motion "
      "on finer meshes, for compare --judge total")
      ->check(one_of(std::array{"leapfrog", "implicit", "ten-node"}));
  add(reference, "--out", a.reference.out, "file to write (default: in the cache, where runs of the scene find it)");
  add_progress(reference, a.reference.progress);

  CLI::App& soak = command("soak", "a long run of a body at rest: fails if it drifts, leaks memory or slows down",
                           [](const Arguments& a) { return run_soak(*a.opened, a.soak); });
  add_scene(soak, a);
  add(soak, "--settle", a.soak.settle, 0L, most_steps, "steps before the watch begins");
  add(soak, "--steps", a.soak.steps, 10L, most_steps, "steps watched");
  add(soak, "--out", a.soak.out, "folder for soak.json and soak.csv");
  add_progress(soak, a.soak.progress);

  CLI::App& bench = command("bench", "fps and ms per step, the paper's protocol and ours",
                            [](const Arguments& a) { return run_bench(a.bench); });
  add(bench, "--scenes,--scene", a.bench.scenes, "scenes, separated by commas");
  add_variations(bench, a.bench.variations);
  add(bench, "--frames", a.bench.frames, 1L, 1000000L, "timed frames");
  add(bench, "--warm-up", a.bench.warm_up, 0L, 1000000L, "frames before them");
  add(bench, "--repeats", a.bench.repeats, 1, 100, "repetitions; the median counts");
  add(bench, "--most-seconds", a.bench.most_seconds, 0.01, 1e6,
      "a repetition ends there with fewer frames; 12 times that bounds the error run");
  add_sizes(bench, "--sizes,--size", a.bench.sizes, "of the rendered frames, WxH, separated by commas");
  std::vector<std::string> kinds;
  for (const PictureKind& kind : picture_kinds) kinds.emplace_back(kind.name);
  add(bench, "--pictures", a.bench.pictures,
      fmt::format("{}: full is as run draws it, the others go without a part", fmt::join(kinds, ", ")))
      ->check(one_of(kinds));
  add_samples(bench, a.bench.samples);
  bench.add_flag_callback(
      "--no-render", [&] { a.bench.sizes.clear(); }, "simulation alone");
  add_fill(bench, a.bench.overrides);
  add_gpu(bench, a.bench.gpu);
  add(bench, "--out", a.bench.out, "folder for bench.csv and bench.json");

  CLI::App& map = command("map", "how right a scene comes out over two settings, and where it fails",
                          [](const Arguments& a) { return run_map(a.map); });
  add(map, "--scene,--scenes", a.map.scene, "a scene");
  add(map, "--x", a.map.x, "a setting and its values: PARAMETER=1,2,5 or PARAMETER=FROM:TO:COUNT");
  add(map, "--y", a.map.y, "another");
  add_vary(map, "a setting: the first across, the second upwards",
           [&a](const std::string& text) { (std::exchange(a.varied, true) ? a.map.y : a.map.x) = text; });
  add(map, "--steps", a.map.steps, 1L, most_steps, "of the scene's own dt (default: its duration)");
  add_overrides(map, a.map.overrides);
  add_parameters(map, a.map.overrides);
  add_gpu(map, a.map.gpu);
  add(map, "--out", a.map.out, "folder for map.html, .csv, .json, .svg, .png");

  CLI::App& compare =
      command("compare", "speed against error over modes x iterations x substeps",
              [](const Arguments& a) { return (a.hard_cases ? run_hard_cases : run_compare)(a.compare); });
  // Options are taken in the order of these lines, so what follows stands above the defaults of hard cases.
  auto* hard = compare.add_flag_callback(
      "--hard-cases",
      [&] {
        a.hard_cases = true;
        vary(a.compare.variations, parse_variation(hard_case_modes, "--hard-cases")), a.compare.steps = 0,
                                                                                      a.compare.out = "stability";
      },
      "instead: which mode recovers from the scenes of models/scenes/hard, and when: from recovered_at_step "
      "on, for the last 5 % of the steps at least, the volume is within 1 %, no tet inverted and hard bodies "
      "within 1 % of their shape; scenes in which no constraint acts are left out");
  add(compare, "--scene,--scenes", a.compare.scene, "a scene");
  add_overrides(compare, a.compare.overrides);
  add_variations(compare, a.compare.variations);
  add_parameters(compare, a.compare.overrides);
  add(compare, "--steps", a.compare.steps, 1L, most_steps, "steps of each run");
  add(compare, "--judge", a.compare.judge,
      "by what: motion (the distance from the right one, found first if need be), volume (largest net loss), "
      "strain, overlap (how deep bodies are in each other), total (the distance from the motion on finer meshes, found "
      "first if need be; default: motion where it is known)")
      ->check(one_of(std::array{"motion", "volume", "strain", "overlap", "total"}));
  add(compare, "--truth", a.compare.truth, "a finer mesh of the first body, for --judge total (default: made)");
  add(compare, "--fills", a.compare.fills,
      "how surfaces are filled, varied as well: auto, tetgen, tetgen:SWITCHES, lattice, lattice:TETS");
  add(compare, "--budget-ms", a.compare.budget_ms, 1e-9, 1e9, "print the best setting within so many ms per step");
  add(compare, "--error", a.compare.error_percent, 1e-9, 1e9, "print the cheapest setting with at most this error, %");
  compare.add_option_function<std::string>(
      "--shard",
      [&](const std::string& text) {
        const auto [i, n] = two_numbers("--shard", text, '/', 1, 99999);
        if (i > n) throw Error("bad share", "--shard " + text, "count i from 1 to n, as in 2/8");
        a.compare.shards.shard = i, a.compare.shards.shards = n;
      },
      "i/n: only every n-th combination, from the i-th; merge them afterwards");
  add(compare, "--cases", a.compare.cases, "hard cases to run (default: all)")->needs(hard);
  add(compare, "--meshes", a.compare.meshes, "hard cases: bunny, block, tet")->needs(hard);
  for (const char* dropped :
       {"--scene", "--iterations", "--substeps", "--rigid-contact", "--mass-splitting", "--omegas", "--constraint-sets",
        "--judge", "--budget-ms", "--error", "--truth", "--fills", "--elements"})
    a.apart.push_back({hard, compare.get_option(dropped)});
  compare.add_option("--merge", a.compare.shards.merge, "folders of finished shards, instead of running");
  add_gpu(compare, a.compare.gpu);
  add(compare, "--out", a.compare.out, "folder for compare.html, .csv, .json, .svg, .png");

  CLI::App& reproduce = command("reproduce", "the paper's table and figures, measured here, with plots and one report",
                                [](const Arguments& a) { return run_reproduce(a.reproduce); });
  add(reproduce, "--out", a.reproduce.out, "folder for report.html, figures, tables");
  reproduce.add_flag("--quick", a.reproduce.quick, "bunny alone, few frames: checks the trends without a GPU");
  add_gpu(reproduce, a.reproduce.gpu);

  CLI::App& mesh = command("mesh", "checks a surface or tetrahedral mesh, tetrahedralises, writes it",
                           [](const Arguments& a) { return run_mesh_command(a.mesh); });
  add(mesh, "file", a.mesh.file, mesh_formats)->required();
  add_fill(mesh, a.mesh.filled);
  add_up(mesh, a.mesh.up, "the file; what is written is turned so that y does");
  add(mesh, "--out", a.mesh.out, "write it: .node or .ele, .msh (tetrahedra); .ply .obj .off .stl (boundary)");
  add(mesh, "--repair", a.mesh.repaired,
      "mend the surface as far as that is safe, and write it: .ply .obj .off .stl; status 1 if it is no solid then. "
      "With --out it is filled as well");
  mesh.add_flag("--json", a.mesh.json, "print the report as JSON");

  CLI::App& info = command("info", "GL version, devices, limits, extensions used, build, licences",
                           [](const Arguments& a) { return (a.selftest ? run_selftest : print_info)(a.run.gpu); });
  add_gpu(info, a.run.gpu);
  info.add_flag("--selftest", a.selftest,
                "check that this device computes what it should, and measure how fast; a minute at most");
}

/// Of these words, which no command took, the first flag, else the first: what it may have been.
[[noreturn]] void refuse_unknown(const CLI::App& app, const std::vector<std::string>& words) {
  const auto parsed = app.get_subcommands();
  const std::string command = parsed.empty() ? "" : " " + parsed[0]->get_name();
  const auto flag = std::ranges::find_if(words, [](const auto& word) { return word.starts_with("-"); });
  const std::string word = flag == words.end() ? words.at(0) : flag->substr(0, flag->find('='));
  std::string mend;
  std::vector<std::string> known;
  const auto take = [&](auto& self, const CLI::App& from) -> void {
    for (const CLI::Option* option : from.get_options())
      for (const std::string& name : option->get_lnames()) known.push_back("--" + name);
    for (const CLI::App* group : from.get_subcommands([](const CLI::App* one) { return one->get_name().empty(); }))
      self(self, *group);
  };
  const auto commands = app.get_subcommands([](const CLI::App* one) { return !one->get_name().empty(); });
  for (const CLI::App* one : commands) {
    if (parsed.empty()) known.push_back(one->get_name());
    if (one->get_option_no_throw(word)) mend += fmt::format("it is an option of tetpbd {}; ", one->get_name());
  }
  for (const CLI::App* one : parsed) take(take, *one);
  take(take, app);
  throw Error(fmt::format("not known here: {}", fmt::join(words, " ")), "tetpbd" + command,
              fmt::format("{}{}see tetpbd{} --help", did_you_mean(word, known), mend, command));
}

}  // namespace

std::function<int()> tetpbd::parse_command_line(std::vector<std::string> words) {
  CLI::App app("tetpbd: Position-Based Dynamics of tetrahedral soft bodies on a GPU", "tetpbd");
  app.set_version_flag("--version", TETPBD_VERSION);
  app.require_subcommand(0, 1);
  app.fallthrough();
  std::string shaders;
  app.add_option("--shaders", shaders,
                 "folder to read shaders from instead of the embedded ones; edits take effect at once in the window");
  Arguments arguments;
  add_commands(app, arguments);

  // Options without a command belong to the window: tetpbd --scene beam.
  if (!words.empty() && words[0].starts_with("--") && words[0] != "--help" && words[0] != "--version" &&
      !words[0].starts_with("--shaders"))
    words.insert(words.begin(), "view");
  std::reverse(words.begin(), words.end());  // the order CLI11 takes them in
  try {
    app.parse(words);
  } catch (const CLI::ExtrasError&) {
    refuse_unknown(app, app.remaining(true));
  } catch (const CLI::ParseError& problem) {
    if (problem.get_exit_code() == 0) {  // --help, --version
      std::ostringstream text;
      app.exit(problem, text, text);
      return [text = text.str()] { return std::fputs(text.c_str(), stdout) < 0 ? 1 : 0; };
    }
    const auto parsed = app.get_subcommands();
    throw Error(problem.what(), "command line",
                fmt::format("see tetpbd {}--help", parsed.empty() ? "" : parsed[0]->get_name() + " "));
  }
  for (const auto& [one, other] : arguments.apart)
    if (one->count() > 0 && other->count() > 0)
      throw Error(fmt::format("{} does not go with {}", other->get_name(), one->get_name()), "command line",
                  "leave out one of the two");
  if (!shaders.empty()) set_shader_folder(shaders);
  if (!arguments.start) {
    arguments.start = start_view;
    arguments.overrides.by_device = true;
    arguments.scene = first_of_window;
    open_scene(arguments);
  }
  return [a = std::move(arguments)] {
    if (a.start != start_view || !a.run.record.empty()) catch_interrupts();  // else there is nothing to finish
    if (!a.run.dump_shaders.empty()) {
      make_output_folder(a.run.dump_shaders);
      set_shader_dump(a.run.dump_shaders.string());
    }
    return a.explain ? print_explanation(*a.opened, a.run.gpu, a.run.steps ? a.run.steps : 3) : a.start(a);
  };
}

static int fail(const std::string& line, int status) {
  std::fflush(stdout);
  print_error("tetpbd: " + printable(line) + "\n");
  return status;
}

int main(int argc, char** argv) {
  // A full quota is then an error of write(), which is reported and cleaned up after.
  std::signal(SIGXFSZ, SIG_IGN);
  try {
    const int status = parse_command_line({argv + std::min(argc, 1), argv + argc})();
    if (std::fflush(stdout) != 0 || std::ferror(stdout))
      throw Error("cannot write", "standard output", "is the disk full?", 1);
    return status;
  } catch (const Error& error) {
    return fail(error.what(), error.exit_status);
  } catch (const std::filesystem::filesystem_error& error) {
    return fail(fmt::format("{}: {}: give another path", error.path1().string(), error.code().message()), 2);
  } catch (const std::bad_alloc&) {
    return fail(fmt::format("out of memory: {}: use a smaller mesh", argc > 1 ? argv[1] : "start"), 1);
  } catch (const std::exception& error) {
    if (std::ferror(stdout)) return fail("cannot write: standard output: is the disk full?", 1);
    return fail(fmt::format("unexpected: {}: please report this", error.what()), 1);
  }
}
