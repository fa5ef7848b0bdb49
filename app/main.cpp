// The command line: what it says becomes a scene, settings and options for one of the commands.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <functional>
#include <iostream>
#include <optional>
#include <sstream>

#include "app/bench.h"
#include "app/command_line.h"
#include "app/compare.h"
#include "app/hard_cases.h"
#include "app/headless.h"
#include "app/mesh_command.h"
#include "app/reproduce.h"
#include "app/scene.h"
#include "app/soak.h"
#include "app/window.h"
#include "sim/error.h"
#include "sim/gl/gpu.h"
#include "sim/interrupt.h"

using namespace tetpbd;

namespace {

/// Options that mean the same in every command that opens a scene.
struct SceneArguments {
  std::string scene = "bunny-drop";
  SceneOverrides overrides;
  std::vector<std::optional<std::string>> values;  ///< text by row of parameters()
  int gpu = -1;
  std::string size = "1280x720";
  int width = 1280, height = 720, samples = 4;
  bool explain = false;
  std::string look = "surface", colour = "plain";
  bool flat = false, no_shadow = false, no_grid = false, no_legend = false, plain = false;
  ViewOptions view;
};

template <class Names>
int index_of(const Names& names, const std::string& name, const char* flag) {
  for (std::size_t i = 0; i < names.size(); ++i)
    if (name == names[i]) return int(i);
  throw Error("unknown value", fmt::format("{} {}", flag, name),
              fmt::format("choose from {}", fmt::join(names, ", ")));
}

// An unset shell variable must not run another experiment than was meant.
const CLI::Validator not_empty(
    [](std::string& text) { return text.empty() ? std::string("must not be empty") : std::string(); }, "");

template <class T>
CLI::Validator in_range(T low, T high) {
  return CLI::Validator(
      [=](std::string& text) {
        T value{};
        if (CLI::detail::lexical_cast(text, value) && value >= low && value <= high) return std::string();
        return fmt::format("must be a {} from {} to {}, not '{}'",
                           std::is_integral_v<T> ? "whole number" : "number", low, high, text);
      },
      fmt::format("[{} .. {}]", low, high));
}

void add_scene_options(CLI::App& command, SceneArguments& a) {
  command
      .add_option("--scene", a.scene,
                  fmt::format("a scene file, or one of {}", fmt::join(scene_names(), ", ")))
      ->capture_default_str();
  command
      .add_option("--mesh", a.overrides.mesh,
                  "mesh in place of the scene's first body (.ply .obj .stl .off .node .ele .msh)")
      ->check(not_empty);
  command.add_option("--tetgen", a.overrides.tetgen, "TetGen switches, pY for the paper's kind of mesh")
      ->check(not_empty);
  command.add_option("--deform", a.overrides.deform,
                     "start shape: none, flatten, line, point, random, mirror, stretch:F, squash:F, "
                     "twist:DEGREES, invert-one, coincident, fold");
  a.values.resize(parameters().size());
  for (std::size_t i = 0; i < parameters().size(); ++i) {
    const Parameter& row = parameters()[i];
    const auto allowed = choices(row);
    std::string help = row.help;
    if (!allowed.empty())
      help += fmt::format(": {}", fmt::join(allowed, ", "));
    else if (std::holds_alternative<bool Settings::*>(row.member))
      help += ": true, false";
    else
      help += fmt::format(" [{:g} .. {:g}{}{}]", row.low, row.high, *row.unit ? " " : "", row.unit);
    command.add_option(flag_name(row), a.values[i], help)->group("Settings")->type_name("VALUE");
  }
  std::string solvers;
  for (const SolverPreset& preset : solver_presets())
    solvers += fmt::format("{} ({}), ", preset.name, preset.help);
  command
      .add_option("--solver", a.overrides.solver,
                  "how to solve, by name; other settings go on top: " + solvers +
                      "auto (tries, and takes what loses least volume within --budget-ms)")
      ->check(not_empty)
      ->type_name("NAME");
  command
      .add_option("--budget-ms", a.overrides.budget_ms,
                  "GPU time a step, for --solver auto (default: a tenth of dt)")
      ->check(in_range(1e-6, 1e6));
  command
      .add_option("--set", a.overrides.set,
                  "PATH=VALUE for anything else in the scene, as in bodies.0.density=500")
      ->expected(1)
      ->take_all()
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  command.add_option("--gpu", a.gpu, "which device of tetpbd info (default: the first GPU)")
      ->check(in_range(0, 1023));
  command.add_option("--size", a.size, "of images and window, WxH")->capture_default_str();
  command.add_option("--samples", a.samples, "of MSAA: 0, 2, 4, 8")
      ->check(CLI::IsMember({0, 2, 4, 8}))
      ->capture_default_str();
  command.add_option("--look", a.look, "surface, wire, tets")->capture_default_str()->group("View");
  command.add_option("--colour", a.colour, "plain, volume, stretch, velocity")
      ->capture_default_str()
      ->group("View");
  command.add_option("--cut", a.view.cut, "tets: show those below this part of the body, 0 .. 1")
      ->check(in_range(0.0, 1.0))
      ->group("View");
  command.add_option("--cut-axis", a.view.cut_axis, "0: x, 1: y, 2: z")->check(in_range(0, 2))->group("View");
  command.add_flag("--flat", a.flat, "flat normals, made in the geometry shader")->group("View");
  command.add_flag("--no-shadow", a.no_shadow, "no shadow")->group("View");
  command.add_flag("--no-grid", a.no_grid, "no lines on the ground")->group("View");
  command.add_flag("--no-legend", a.no_legend, "no colour bar")->group("View");
  command.add_flag("--plain", a.plain, "the cheapest picture: flat faces on one colour")->group("View");
  command.add_flag("--explain", a.explain, "print what the scene allocates and dispatches, and stop");
}

void parse_size(const std::string& size, int& width, int& height) {
  const std::size_t cross = size.find('x');
  const auto whole = [](const std::string& text, int& target) {
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), target);
    return error == std::errc() && end == text.data() + text.size() && target >= 16 && target <= 16384;
  };
  if (cross == std::string::npos || !whole(size.substr(0, cross), width) ||
      !whole(size.substr(cross + 1), height))
    throw Error("bad size", "--size " + size, "write WIDTHxHEIGHT, each from 16 to 16384, as in 1280x720");
}

void parse_shard(const std::string& text, int& shard, int& shards) {
  int end = 0;
  if (std::sscanf(text.c_str(), "%d/%d%n", &shard, &shards, &end) != 2 || end != int(text.size()) ||
      shard < 1 || shards < shard)
    throw Error("bad shard", "--shard " + text, "write i/n with i from 1 to n, as in 2/8");
}

Scene scene_of(SceneArguments& a) {
  parse_size(a.size, a.width, a.height);
  a.view.look = Look(index_of(look_names, a.look, "--look"));
  a.view.colour = Colour(index_of(colour_names, a.colour, "--colour"));
  if (a.plain) a.view = plain_view(a.view);
  if (a.flat) a.view.smooth_normals = false;
  if (a.no_shadow) a.view.shadow = false;
  if (a.no_grid) a.view.grid = false;
  if (a.no_legend) a.view.legend = false;
  for (std::size_t i = 0; i < parameters().size(); ++i)
    if (a.values[i]) a.overrides.parameters.emplace_back(parameters()[i].name, *a.values[i]);
  return load_scene(a.scene, a.overrides);
}

}  // namespace

std::function<int()> tetpbd::parse_command_line(std::vector<std::string> words) {
  CLI::App app("tetpbd: Position-Based Dynamics of tetrahedral soft bodies on a GPU");
  app.set_version_flag("--version", TETPBD_VERSION);
  app.name("tetpbd");
  app.require_subcommand(0, 1);
  app.fallthrough();
  std::string shaders;
  app.add_option(
      "--shaders", shaders,
      "folder to read shaders from instead of the embedded ones; edits take effect at once in the window");

  SceneArguments scene;
  auto* view = app.add_subcommand("view", "a window (the default where there is a display)");
  add_scene_options(*view, scene);

  auto* run = app.add_subcommand("run", "headless: steps a scene, writes frames, video, statistics");
  add_scene_options(*run, scene);
  RunOptions options;
  run->add_option("--steps", options.steps, "steps to take (default: the scene's duration)")
      ->check(in_range(1L, 1000000000L));
  run->add_option("--out", options.out, "folder for stats.json, stats.csv, frames")->capture_default_str();
  run->add_option("--png-every", options.png_every, "write frame_NNNNN.png every K steps")
      ->check(in_range(1L, 1000000000L));
  run->add_option("--video", options.video,
                  "write a video (.mp4 .mkv .webm .gif) through ffmpeg, in real time");
  run->add_option("--video-every", options.video_every,
                  "steps a video frame (default: real time at 30 frames a second)")
      ->check(in_range(1L, 1000000000L));
  run->add_option("--csv-every", options.csv_every, "a row of stats.csv every K steps, 0: none")
      ->check(in_range(0L, 1000000000L))
      ->capture_default_str();
  run->add_option("--measure-every", options.measure_every,
                  "measure errors every K steps and at the end; largest values are over the measured steps")
      ->check(in_range(1L, 1000000000L))
      ->capture_default_str();
  run->add_flag("--positions", options.positions, "write positions.npy and tets.npy");
  run->add_flag("--progress", options.progress, "show progress even if standard error is no terminal");

  auto* soak = app.add_subcommand(
      "soak", "a long run of a body at rest: fails if it drifts, leaks memory or slows down");
  add_scene_options(*soak, scene);
  SoakOptions soak_options;
  soak->add_option("--settle", soak_options.settle, "steps before the watch begins")
      ->check(in_range(0L, 1000000000L))
      ->capture_default_str();
  soak->add_option("--steps", soak_options.steps, "steps watched")
      ->check(in_range(10L, 1000000000L))
      ->capture_default_str();
  soak->add_option("--out", soak_options.out, "folder for soak.json and soak.csv")->capture_default_str();
  soak->add_flag("--progress", soak_options.progress, "show progress even if standard error is no terminal");

  auto* bench = app.add_subcommand("bench", "fps and ms a step, the paper's protocol and ours");
  BenchOptions bench_options;
  std::vector<std::string> bench_sizes = {"1280x720"};
  bool no_render = false;
  bench->add_option("--scenes,--scene", bench_options.scenes, "scenes, separated by commas")
      ->delimiter(',')
      ->capture_default_str();
  bench
      ->add_option("--modes,--mode", bench_options.modes,
                   "solver modes, node+handles, paper (the pipeline as published)")
      ->delimiter(',')
      ->capture_default_str();
  bench->add_option("--constraint-sets", bench_options.constraint_sets, "sets of kinds joined by +")
      ->delimiter(',')
      ->capture_default_str();
  bench->add_option("--iterations", bench_options.iterations, "iterations a substep")
      ->delimiter(',')
      ->check(in_range(1, 100000))
      ->capture_default_str();
  bench->add_option("--substeps", bench_options.substeps, "substeps a step")
      ->delimiter(',')
      ->check(in_range(1, 100000))
      ->capture_default_str();
  bench->add_option("--frames", bench_options.frames, "timed frames")
      ->check(in_range(1L, 1000000L))
      ->capture_default_str();
  bench->add_option("--warm-up", bench_options.warm_up, "frames before them")
      ->check(in_range(0L, 1000000L))
      ->capture_default_str();
  bench->add_option("--repeats", bench_options.repeats, "repetitions; the median counts")
      ->check(in_range(1, 100))
      ->capture_default_str();
  bench
      ->add_option("--most-seconds", bench_options.most_seconds,
                   "a repetition ends there with fewer frames; 12 times that bounds the error run")
      ->check(in_range(0.01, 1e6))
      ->capture_default_str();
  bench->add_option("--sizes,--size", bench_sizes, "of the rendered frames, WxH, separated by commas")
      ->delimiter(',')
      ->capture_default_str();
  bench
      ->add_option("--pictures", bench_options.pictures,
                   "plain (flat faces on one colour), full (as run draws it), separated by commas")
      ->delimiter(',')
      ->check(CLI::IsMember({"plain", "full"}))
      ->capture_default_str();
  bench->add_option("--samples", bench_options.samples, "of MSAA: 0, 2, 4, 8")
      ->check(CLI::IsMember({0, 2, 4, 8}))
      ->capture_default_str();
  bench->add_flag("--no-render", no_render, "simulation alone");
  bench->add_option("--tetgen", bench_options.overrides.tetgen,
                    "TetGen switches, pY for the paper's kind of mesh");
  bench->add_option("--gpu", bench_options.gpu, "which device")->check(in_range(0, 1023));
  bench->add_option("--out", bench_options.out, "folder for bench.csv and bench.json")->capture_default_str();

  auto* compare = app.add_subcommand("compare", "speed against error over modes x iterations x substeps");
  CompareOptions compare_options;
  std::string shard = "1/1";
  compare->add_option("--scene", compare_options.scene, "a scene")->capture_default_str();
  compare->add_option("--mesh", compare_options.overrides.mesh, "mesh in place of the scene's first body");
  compare->add_option("--tetgen", compare_options.overrides.tetgen,
                      "TetGen switches, pY for the paper's kind of mesh");
  compare->add_option("--set", compare_options.overrides.set, "PATH=VALUE for anything else in the scene")
      ->expected(1)
      ->take_all();
  compare
      ->add_option("--modes", compare_options.modes,
                   "solver modes, node+handles, paper (the pipeline as published)")
      ->delimiter(',')
      ->capture_default_str();
  compare->add_option("--iterations", compare_options.iterations, "iterations a substep")
      ->delimiter(',')
      ->check(in_range(1, 100000))
      ->capture_default_str();
  compare->add_option("--substeps", compare_options.substeps, "substeps a step")
      ->delimiter(',')
      ->check(in_range(1, 100000))
      ->capture_default_str();
  compare->add_option("--omegas", compare_options.omegas, "over-relaxations (default: the scene's)")
      ->delimiter(',')
      ->check(in_range(0.0, 4.0));
  compare->add_option("--steps", compare_options.steps, "steps of each run")
      ->check(in_range(1L, 1000000000L))
      ->capture_default_str();
  compare
      ->add_option("--budget-ms", compare_options.budget_ms, "print the best setting within that time a step")
      ->check(in_range(1e-9, 1e9));
  compare
      ->add_option("--error", compare_options.error_percent,
                   "print the cheapest setting that loses at most this volume, %")
      ->check(in_range(1e-9, 1e9));
  compare
      ->add_option("--shard", shard, "i/n: only every n-th combination, from the i-th; merge them afterwards")
      ->capture_default_str();
  HardCaseOptions hard;
  bool hard_cases = false;
  auto* hard_flag =
      compare->add_flag("--hard-cases", hard_cases,
                        "instead: which mode recovers from the scenes of models/scenes/hard, and when: from "
                        "recovered_at_step on, for the last 5 % of the steps at least, the volume is within "
                        "1 % and no tet inverted; scenes in which no constraint acts are left out");
  compare->add_option("--cases", hard.cases, "hard cases to run (default: all)")
      ->delimiter(',')
      ->needs(hard_flag);
  compare->add_option("--meshes", hard.meshes, "hard cases: bunny, block, tet")
      ->delimiter(',')
      ->capture_default_str()
      ->needs(hard_flag);
  compare->add_option("--merge", compare_options.merge, "folders of finished shards, instead of running");
  compare->add_option("--gpu", compare_options.gpu, "which device")->check(in_range(0, 1023));
  compare->add_option("--out", compare_options.out, "folder for compare.csv, .json, .svg, .png")
      ->capture_default_str();

  auto* reproduce = app.add_subcommand(
      "reproduce", "the paper's table and figures, measured here, with plots and one report");
  ReproduceOptions reproduce_options;
  reproduce->add_option("--out", reproduce_options.out, "folder for report.html, figures, tables")
      ->capture_default_str();
  reproduce->add_flag("--quick", reproduce_options.quick,
                      "bunny alone, few frames: checks the trends without a GPU");
  reproduce->add_option("--gpu", reproduce_options.gpu, "which device")->check(in_range(0, 1023));

  auto* mesh = app.add_subcommand("mesh", "checks a surface or tetrahedral mesh, tetrahedralises, writes it");
  std::filesystem::path mesh_file, mesh_out;
  std::string mesh_switches = "pYq1.85o/140";
  bool mesh_json = false;
  mesh->add_option("file", mesh_file, ".ply .obj .stl .off (surface), .node .ele .msh (tetrahedra)")
      ->required();
  mesh->add_option("--tetgen", mesh_switches, "TetGen switches")->capture_default_str();
  mesh->add_option("--out", mesh_out,
                   "write it: .node or .ele, .msh (tetrahedra); .ply .obj .off .stl (boundary)");
  mesh->add_flag("--json", mesh_json, "print the report as JSON");

  auto* info = app.add_subcommand("info", "GL version, devices, limits, extensions used, build, licences");
  int info_gpu = -1;
  info->add_option("--gpu", info_gpu, "which device")->check(in_range(0, 1023));

  // Options without a command belong to the window: tetpbd --scene beam.
  if (!words.empty() && words[0].starts_with("--") && words[0] != "--help" && words[0] != "--version" &&
      !words[0].starts_with("--shaders"))
    words.insert(words.begin(), "view");
  std::reverse(words.begin(), words.end());  // the order CLI11 takes them in
  try {
    app.parse(words);
  } catch (const CLI::ParseError& problem) {
    if (problem.get_exit_code() == 0) {  // --help, --version
      std::ostringstream text;
      app.exit(problem, text, text);
      return [text = text.str()] { return std::fputs(text.c_str(), stdout) < 0 ? 1 : 0; };
    }
    const std::string what = problem.what();
    const auto parsed = app.get_subcommands();
    const std::string command = parsed.empty() ? "" : " " + parsed[0]->get_name();
    throw Error(what, "command line", fmt::format("see tetpbd{} --help", command));
  }
  if (!shaders.empty()) set_shader_folder(shaders);

  if (*info) return [=] { return print_info(info_gpu); };
  if (*mesh) return [=] { return run_mesh_command(mesh_file, mesh_switches, mesh_out, mesh_json); };
  if (*bench) {
    for (const std::string& size : bench_sizes) {
      bench_options.sizes.emplace_back();
      parse_size(size, bench_options.sizes.back()[0], bench_options.sizes.back()[1]);
    }
    if (no_render) bench_options.sizes.clear();
    return [=] { return run_bench(bench_options); };
  }
  if (*reproduce) return [=] { return run_reproduce(reproduce_options); };
  if (*compare) {
    parse_shard(shard, compare_options.shard, compare_options.shards);
    if (hard_cases) {
      if (compare->count("--modes")) hard.modes = compare_options.modes;
      if (compare->count("--steps")) hard.steps = compare_options.steps;
      if (compare->count("--out")) hard.out = compare_options.out;
      hard.gpu = compare_options.gpu, hard.merge = compare_options.merge;
      hard.shard = compare_options.shard, hard.shards = compare_options.shards;
      return [=] { return run_hard_cases(hard); };
    }
    return [=] { return run_compare(compare_options); };
  }
  if (*run || scene.explain) {
    const Scene opened = scene_of(scene);
    if (scene.explain) return [opened, gpu = scene.gpu] { return print_explanation(opened, gpu); };
    options.gpu = scene.gpu;
    options.width = scene.width, options.height = scene.height, options.samples = scene.samples;
    options.view = scene.view;
    return [=] { return run_headless(opened, options); };
  }
  if (*soak) {
    soak_options.gpu = scene.gpu;
    return [opened = scene_of(scene), soak_options] { return run_soak(opened, soak_options); };
  }
  if (!std::getenv("DISPLAY") && !std::getenv("WAYLAND_DISPLAY"))
    throw Error("no display", "DISPLAY and WAYLAND_DISPLAY are not set",
                "start it in a desktop session, or use tetpbd run");
  if (!*view) scene.values.resize(parameters().size());
  const Scene opened = scene_of(scene);
  return [=] {
    return run_window(opened,
                      {scene.scene, scene.overrides, scene.width, scene.height, scene.samples, scene.view});
  };
}

// Not fmt::print(), which throws where standard error cannot be written.
static int fail(const std::string& line, int status) {
  std::fflush(stdout);
  std::fputs(("tetpbd: " + printable(line) + "\n").c_str(), stderr);
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
  } catch (const std::bad_alloc&) {
    return fail(fmt::format("out of memory: {}: use a smaller mesh", argc > 1 ? argv[1] : "start"), 1);
  } catch (const std::exception& error) {
    if (std::ferror(stdout)) return fail("cannot write: standard output: is the disk full?", 1);
    return fail(fmt::format("unexpected: {}: please report this", error.what()), 1);
  }
}
