// The commands: the options of each, and what it starts.
#include <cstdlib>

#include "app/export.h"
#include "app/options.h"
#include "app/window/lanes.h"
#include "app/window/record.h"
#include "sim/error.h"

namespace tetpbd {

int start_view(const Arguments& a) {
  if (!std::getenv("DISPLAY") && !std::getenv("WAYLAND_DISPLAY"))
    throw Error("no display", "DISPLAY and WAYLAND_DISPLAY are not set",
                "start it in a desktop session, or use tetpbd run");
  for (const std::string& words : a.run.lanes)
    lane_settings(a.opened->settings, words, "--lane " + words, nullptr, a.opened->bodies.size());
  return run_window(*a.opened, a.scene, a.overrides, a.run);
}

namespace {

void add_view(CLI::App& view, Arguments& a) {
  add_scene(view, a, true);
  view.add_option("--lane", a.run.lanes,
                  "up to 4 lanes, solvers side by side: a solver preset or mode, or PARAMETER=VALUE, or "
                  "budget_ms=MILLISECONDS for --solver auto, separated by commas")
      ->type_name("WORDS")
      ->expected(1, int(most_lanes));
  add(view, "--history-mb", a.run.history_mb, 0L, 1000000L, "memory in MB for going back in time; 0: none");
  add(view, "--record", a.run.record, "record all actions in this file, for tetpbd run --replay");
}

void add_run(CLI::App& run, Arguments& a) {
  add_scene(run, a, true);
  add(run, "--steps", a.run.steps, 1L, most_steps, "steps to take (default: the scene's duration)");
  add(run, "--out", a.run.out, "folder for stats.json, stats.csv, frames");
  add(run, "--png-every", a.run.png_every, 1L, most_steps, "write frame_NNNNN.png every K steps");
  add(run, "--video", a.run.video, "write a video (.mp4 .mkv .webm .gif) through ffmpeg, in real time");
  add(run, "--video-every", a.run.video_every, 1L, most_steps, "steps per video frame (default: those of 1/30 s)");
  add(run, "--turntable", a.run.turntable, 1e-3, 1e9, "the camera orbits the bodies once in this many s");
  add(run, "--camera-path", a.run.camera_path,
      "a JSON list of cameras as in a scene, each with its \"time\" in s, which the camera passes through")
      ->excludes("--turntable", "--follow");
  add(run, "--csv-every", a.run.csv_every, 0L, most_steps, "a row of stats.csv every K steps, 0: none");
  add(run, "--reference", a.run.reference,
      "file of the reference motion, made by tetpbd reference (default: that in the cache)");
  add(run, "--measure-every", a.run.measure_every, 1L, most_steps, "measure errors every K steps and at the end");
  run.add_flag("--positions", a.run.positions,
               "write positions, velocities, rest (positions), tets, faces and bodies (of vertices) as .npy");
  add(run, "--save-state", a.run.save_state, "write the final state, complete, to this file");
  add(run, "--from-state", a.run.from_state,
      "continue from a saved state for --steps further steps; with the same settings, bit for bit");
  add(run, "--positions-every", a.run.positions_every, 1L, most_steps,
      "the same, and positions every K steps in trajectory.npy");
  add(run, "--export", a.run.exports,
      "frames for other programs: vtk (ParaView), pc2 (Blender's mesh cache, with an OBJ), ply (surfaces), every "
      "--positions-every steps (default: every 1/30 s)")
      ->check(one_of(export_formats));
  add(run, "--dump-shaders", a.run.dump_shaders, "write each shader of the run, as it is compiled, to this folder");
  run.add_flag("--check-crossings", a.run.check_crossings,
               "after every step, test exactly whether surfaces intersect; if they do, end the run with status 1");
  CLI::Option* replay =
      add(run, "--replay", a.run.replay,
          "instead: replay a record of tetpbd view --record, lanes included; with --video, at the speed it was played");
  for (const char* dropped : {"--save-state", "--from-state",     "--scene",     "--mesh",        "--tetgen",
                              "--set",        "--deform",         "--solver",    "--budget-ms",   "--explain",
                              "--steps",      "--png-every",      "--positions", "--video-every", "--csv-every",
                              "--reference",  "--measure-every",  "--turntable", "--camera-path", "--positions-every",
                              "--export",     "--height",         "--fill",      "--tets",        "--spacing",
                              "--up",         "--check-crossings"})
    a.apart.push_back({replay, run.get_option(dropped)});
  for (const Parameter& row : parameters()) a.apart.push_back({replay, run.get_option(flag_name(row))});
  run.add_flag("--strict", a.run.strict, "exit status 1 also if the verdict is doubtful");
  add_progress(run, a.run.progress);
}

void add_reference(CLI::App& reference, Arguments& a) {
  add_scene(reference, a);
  add(reference, "--steps", a.reference.steps, 1L, most_steps, "steps of the scene (default: its duration)");
  add(reference, "--method", a.reference.method,
      "leapfrog or implicit, for soft bodies (default: leapfrog, unless its steps are too short); ten-node: the motion "
      "on finer meshes, for compare --judge total")
      ->check(one_of(std::array{"leapfrog", "implicit", "ten-node"}));
  add(reference, "--out", a.reference.out, "file to write (default: in the cache, where runs of the scene find it)");
  add_progress(reference, a.reference.progress);
}

void add_soak(CLI::App& soak, Arguments& a) {
  add_scene(soak, a);
  add(soak, "--settle", a.soak.settle, 0L, most_steps, "steps before measuring begins");
  add(soak, "--steps", a.soak.steps, 10L, most_steps, "steps measured");
  add(soak, "--out", a.soak.out, "folder for soak.json and soak.csv");
  add_progress(soak, a.soak.progress);
}

void add_bench(CLI::App& bench, Arguments& a) {
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
      fmt::format("{}: full is as run draws it, the others leave a part out", fmt::join(kinds, ", ")))
      ->check(one_of(kinds));
  add_samples(bench, a.bench.samples);
  bench.add_flag_callback(
      "--no-render", [&] { a.bench.sizes.clear(); }, "simulation only");
  add_fill(bench, a.bench.overrides);
  add_copies(bench, a.bench.overrides);
  add_gpu(bench, a.bench.gpu);
  add(bench, "--out", a.bench.out, "folder for bench.csv and bench.json");
}

void add_map(CLI::App& map, Arguments& a) {
  add(map, "--scene,--scenes", a.map.scene, "a scene");
  add(map, "--x", a.map.x, "setting along x and its values: PARAMETER=1,2,5 or PARAMETER=FROM:TO:COUNT");
  add(map, "--y", a.map.y, "setting along y, likewise");
  add_vary(map, "a setting: the first across, the second upwards",
           [&a](const std::string& text) { (std::exchange(a.varied, true) ? a.map.y : a.map.x) = text; });
  add(map, "--steps", a.map.steps, 1L, most_steps, "of the scene's own dt (default: its duration)");
  add_overrides(map, a.map.overrides);
  add_parameters(map, a.map.overrides);
  add_gpu(map, a.map.gpu);
  add(map, "--out", a.map.out, "folder for map.html, .csv, .json, .svg, .png");
}

void add_compare(CLI::App& compare, Arguments& a) {
  // Options are taken in the order of these lines, so what follows stands above the defaults of hard cases.
  auto* hard = compare.add_flag_callback(
      "--hard-cases",
      [&] {
        a.hard_cases = true;
        vary(a.compare.variations, parse_variation(hard_case_modes, "--hard-cases")), a.compare.steps = 0,
                                                                                      a.compare.out = "stability";
      },
      "instead: which modes recover from the scenes of models/scenes/hard, and when: from recovered_at_step on, and "
      "for at least the last 5 % of the steps, volume is within 1 %, no tet is inverted and hard bodies are within 1 % "
      "of their shape; scenes in which no constraint acts are skipped");
  add(compare, "--scene,--scenes", a.compare.scene, "a scene");
  add_overrides(compare, a.compare.overrides);
  add_variations(compare, a.compare.variations);
  add_parameters(compare, a.compare.overrides);
  add(compare, "--steps", a.compare.steps, 1L, most_steps, "steps of each run");
  add(compare, "--judge", a.compare.judge,
      "error to compare: motion (distance from the reference motion, computed first if missing), volume (largest net "
      "loss), strain, overlap (penetration of bodies), total (distance from the motion on finer meshes, computed first "
      "if missing); default: motion where its reference is known")
      ->check(one_of(std::array{"motion", "volume", "strain", "overlap", "total"}));
  add(compare, "--truth", a.compare.truth, "a finer mesh of the first body, for --judge total (default: made)");
  add(compare, "--fills", a.compare.fills, "meshings to compare: auto, tetgen, tetgen:SWITCHES, lattice, lattice:TETS");
  add(compare, "--budget-ms", a.compare.budget_ms, 1e-9, 1e9,
      "print the most accurate setting within this many ms per step");
  add(compare, "--error", a.compare.error_percent, 1e-9, 1e9, "print the fastest setting with at most this error, %");
  compare.add_option_function<std::string>(
      "--shard",
      [&](const std::string& text) {
        const auto [i, n] = two_numbers("--shard", text, '/', 1, 99999);
        if (i > n) throw Error("bad share", "--shard " + text, "count i from 1 to n, as in 2/8");
        a.compare.shards.shard = i, a.compare.shards.shards = n;
      },
      "i/n: only every n-th combination, from the i-th; join them with --merge");
  add(compare, "--cases", a.compare.cases, "hard cases to run (default: all)")->needs(hard);
  add(compare, "--meshes", a.compare.meshes, "hard cases: bunny, block, tet")->needs(hard);
  for (const char* dropped :
       {"--scene", "--iterations", "--substeps", "--rigid-contact", "--mass-splitting", "--omegas", "--constraint-sets",
        "--judge", "--budget-ms", "--error", "--truth", "--fills", "--elements"})
    a.apart.push_back({hard, compare.get_option(dropped)});
  compare.add_option("--merge", a.compare.shards.merge, "folders of finished shards, instead of running");
  add_gpu(compare, a.compare.gpu);
  add(compare, "--out", a.compare.out, "folder for compare.html, .csv, .json, .svg, .png");
}

void add_reproduce(CLI::App& reproduce, Arguments& a) {
  add(reproduce, "--out", a.reproduce.out, "folder for report.html, figures, tables");
  reproduce.add_flag("--quick", a.reproduce.quick, "only the bunny, few frames: checks the trends without a GPU");
  add_gpu(reproduce, a.reproduce.gpu);
}

void add_mesh(CLI::App& mesh, Arguments& a) {
  add(mesh, "file", a.mesh.file, mesh_formats)->required();
  add_fill(mesh, a.mesh.filled);
  add_up(mesh, a.mesh.up, "the file; output is rotated to Y-up");
  add(mesh, "--out", a.mesh.out, "write the mesh: .node or .ele, .msh (tetrahedra); .ply .obj .off .stl (boundary)");
  add(mesh, "--repair", a.mesh.repaired,
      "repair the surface as far as is safe, and write it: .ply .obj .off .stl; status 1 if it still bounds no solid. "
      "With --out it is tetrahedralized as well");
  mesh.add_flag("--json", a.mesh.json, "print the report as JSON");
}

void add_info(CLI::App& info, Arguments& a) {
  add_gpu(info, a.run.gpu);
  info.add_flag("--selftest", a.selftest,
                "compare this device's results with the CPU's, and measure its speed; at most a minute");
}

}  // namespace

const std::vector<Command>& commands() {
  static const std::vector<Command> rows = {
      {"view", "a window (the default where there is a display)", add_view, start_view},
      {"run", "headless: steps a scene, writes frames, video, statistics", add_run,
       [](const Arguments& a) { return a.run.replay.empty() ? run_headless(*a.opened, a.run) : run_replay(a.run); }},
      {"reference", "computes and caches the reference motion of a scene, which errors are measured against",
       add_reference, [](const Arguments& a) { return run_reference(*a.opened, a.reference); }},
      {"soak", "a long run of a body at rest: fails if it drifts, leaks memory or slows down", add_soak,
       [](const Arguments& a) { return run_soak(*a.opened, a.soak); }},
      {"bench", "frames per second and ms per step, by the paper's protocol and our own", add_bench,
       [](const Arguments& a) { return run_bench(a.bench); }},
      {"map", "stability map: error over two settings, and where a scene fails", add_map,
       [](const Arguments& a) { return run_map(a.map); }},
      {"compare", "speed against error over modes, substeps and iterations", add_compare,
       [](const Arguments& a) { return (a.hard_cases ? run_hard_cases : run_compare)(a.compare); }},
      {"reproduce", "the paper's table and figures, measured here, with plots and one report", add_reproduce,
       [](const Arguments& a) { return run_reproduce(a.reproduce); }},
      {"mesh", "checks, repairs and tetrahedralizes a mesh", add_mesh,
       [](const Arguments& a) { return run_mesh_command(a.mesh); }},
      {"info", "GL version, devices, limits, extensions used, build, licences", add_info,
       [](const Arguments& a) { return (a.selftest ? run_selftest : print_info)(a.run.gpu); }},
  };
  return rows;
}

}  // namespace tetpbd
