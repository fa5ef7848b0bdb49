// The commands: what each is asked for, and what starts it, which returns the exit status. A run steps and
// measures (run.h), variations combine settings (vary.h), a sweep makes rows and merges shards, a chart draws; a
// command is its columns and its judgement. Names in files are relied upon by scripts (docs/guide.md): they may be
// added to, not changed.
#pragma once

#include <array>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "app/lab/reference_command.h"
#include "app/lab/run.h"
#include "app/lab/sweep.h"
#include "app/lab/vary.h"
#include "app/scene.h"
#include "render/frame.h"
#include "sim/reference/reference.h"

namespace tetpbd {

/// The words after the program's name. Loads and checks the scene they name, and returns what is left to do;
/// calling that gives the exit status. Throws Error for words that make no command.
std::function<int()> parse_command_line(std::vector<std::string> words);

struct RunOptions {
  long steps = 0;  ///< 0: the scene's duration
  std::filesystem::path out = "out";
  long png_every = 0;                  ///< steps; 0: no frames
  std::filesystem::path video;         ///< empty: none
  long video_every = 0;                ///< steps a video frame; 0: real time at 30 frames a second
  long csv_every = 1;                  ///< steps; 0: no stats.csv
  std::filesystem::path reference;     ///< the reference motion; empty: the cache's, if any
  long measure_every = 1;              ///< steps between measurements; the last step is measured in any case
  bool positions = false;              ///< of the end, as arrays
  std::filesystem::path from_state;    ///< what it goes on from; empty: the scene's start
  std::filesystem::path save_state;    ///< what its end is written to; empty: nothing
  long positions_every = 0;            ///< steps a frame of trajectory.npy and exports; 0: of exports, real time
  std::vector<std::string> exports;    ///< of export_formats
  std::filesystem::path dump_shaders;  ///< folder for the text of all shaders; empty: none
  int gpu = -1;
  std::array<int, 2> size{1280, 720};  ///< pixels
  int samples = 4;
  ViewOptions view;
  double range = 0;                   ///< end of the colour scale, in its unit; 0: as it is
  double turntable = 0;               ///< s a turn of the camera about the bodies; 0: none
  std::filesystem::path camera_path;  ///< empty: none
  std::vector<std::string> lanes;     ///< of the window: what each puts in place of the scene's settings (lanes.h)
  long history_mb = 256;              ///< of the window: for states to go back to; 0: none
  std::filesystem::path record;       ///< of the window: what is done there (record.h); empty: nowhere
  std::filesystem::path replay;       ///< what `run` does in place of a scene's steps
  bool check_crossings = false;       ///< exact, after every step; the first ends the run with status 1
  bool strict = false;                ///< a doubtful verdict is status 1
  bool progress = false;              ///< show it even if standard error is no terminal
};
/// `tetpbd run`: steps a scene without a window and writes frames, video and statistics.
int run_headless(Scene scene, const RunOptions& options);
/// Prints buffers, bytes, kernels and dispatches a step.
int print_explanation(Scene scene, int gpu, long steps);
int print_info(int gpu);
/// `tetpbd info --selftest`: whether this device computes what it should, and how fast; ends with a line to
/// share. Throws Error (status 1) if a check fails.
int run_selftest(int gpu);

/// `tetpbd view`: until the window is closed. `name` as it was given, a name or a file; `overrides` stay in
/// force when the same scene is reset. Of the options: size, samples, view.
int run_window(const Scene& scene, const std::string& name, const SceneOverrides& overrides, const RunOptions& options);

struct MeshOptions {
  std::filesystem::path file{};
  SceneOverrides filled{.tetgen = FillOptions().switches};  ///< how surfaces are
  std::string up = "y";                                     ///< the file's axis that is turned upwards
  std::filesystem::path repaired{};  ///< where a surface goes, mended as repair() of tet_mesh.h does
  std::filesystem::path out{};       ///< where the mesh goes; both empty: nowhere
  bool json = false;
};
/// `tetpbd mesh`: checks a mesh, mends and fills a surface, reports, writes. The status is 1 where what is mended is
/// still no solid.
int run_mesh_command(const MeshOptions& options);

struct BenchOptions {
  std::vector<std::string> scenes = {"bunny-drop", "armadillo-drop", "dragon-drop"};
  SceneOverrides overrides;  ///< for every scene
  std::vector<Variation> variations =
      parse_variations({"constraints=stretch+bend,stretch+bend+volume", "mode=cpu,constraint,node", "rigid_contact=0",
                        "mass_splitting=0", "iterations=1,150", "substeps=1"});
  long frames = 400, warm_up = 50;
  int repeats = 3;
  double most_seconds = 5;                             ///< a repetition stops there, with fewer frames (slow CPU modes)
  std::vector<std::array<int, 2>> sizes{{1280, 720}};  ///< of rendered frames, pixels; none: no rendering
  std::vector<std::string> pictures = {"plain", "full"};  ///< of picture_kinds, rendered at each size
  int samples = 0;
  int gpu = -1;
  std::filesystem::path out = "bench";
};
/// The full picture, and it without a part or with another, to tell what each costs.
struct PictureKind {
  const char* name;
  ViewOptions view;
};
inline const std::array<PictureKind, 7> picture_kinds{{{"full", {}},
                                                       {"plain", plain_view({})},
                                                       {"flat", {.smooth_normals = false}},
                                                       {"no-shadow", {.shadow = false}},
                                                       {"no-grid", {.grid = false}},
                                                       {"no-ground", {.backdrop = false}},
                                                       {"wire", {.look = Look::wire}}}};
/// `tetpbd bench`: frames a second and ms a step, by the paper's protocol, beside the error of the setting.
int run_bench(const BenchOptions& options);
/// Its rows, to be made in the current context.
Sweep bench_sweep(const BenchOptions& options);
/// What a dispatch and a byte cost on this GPU at least, what speeds are held against: a dispatch of as many
/// invocations as a small mesh has, and its barrier; bytes read and written by a kernel that copies from
/// memory, not from a cache. About a tenth of a second.
ordered_json launch_and_bandwidth_limits(bool software);

struct CompareOptions {
  std::string scene = "bunny-drop";
  SceneOverrides overrides;
  std::vector<Variation> variations =
      parse_variations({"iterations=1,5,10,25", "substeps=1"});  ///< no modes: what suits the scene
  long steps = 400;
  int gpu = -1;
  std::filesystem::path out = "compare";
  Shards shards;
  std::optional<double> budget_ms, error_percent;
  std::string judge;               ///< motion, volume, strain, overlap, total; empty: motion where that is known
  std::filesystem::path truth;     ///< a finer mesh of the first body, for total; empty: made (truth.h)
  std::vector<std::string> fills;  ///< "tetgen", "tetgen:SWITCHES", "lattice:TETS"; empty: the scene's
  std::vector<std::string> cases;  ///< of hard cases; empty: all of models/scenes/hard
  std::vector<std::string> meshes = {"bunny", "block", "tet"};
};
/// `tetpbd compare`: speed against error over modes, substeps and iterations.
int run_compare(const CompareOptions& options);

struct MapOptions {
  std::string scene = "beam", x = "omega=0.5:4:8", y = "iterations=1,2,5,10,25,50";
  SceneOverrides overrides;
  long steps = 0;  ///< of the scene's own dt; 0: its duration
  int gpu = -1;
  std::filesystem::path out = "map";
};
/// `tetpbd map`: the scene's duration for each pair of values of two settings, held against the reference motion,
/// which is found anew where they change it.
int run_map(const MapOptions& options);

/// `tetpbd compare --hard-cases`: which solver mode recovers from what, beside Gauss-Seidel in double. Of
/// what varies only modes count: NAME-substeps runs mode NAME with one iteration a substep, as many substeps as the
/// scene has iterations. Steps 0: the scene's duration.
int run_hard_cases(const CompareOptions& options);
inline constexpr const char* hard_case_modes = "mode=node,constraint,node-substeps,cpu,cpu-double";
/// The first step of those at the end that all keep the volume within 1 %, no tet inverted and, of `hard`
/// bodies, their shape within 1 % of the size, if they are 5 % of the run's `steps` at least: what is good
/// for less long may be passing through.
std::optional<long> recovered_at(const std::vector<Measurement>& measurements, long steps, bool hard);

struct ReproduceOptions {
  std::filesystem::path out = "reproduce";
  bool quick = false;  ///< bunny alone, few frames: checks the trends on a software renderer
  int gpu = -1;
};
/// `tetpbd reproduce`: the paper's table and figures (Va, Choi, Hong 2023), measured here. Throws Error
/// (status 1) if a trend of the paper does not show.
int run_reproduce(const ReproduceOptions& options);

struct SoakOptions {
  long settle = 2000;   ///< steps before the watch begins
  long steps = 100000;  ///< steps watched
  std::filesystem::path out = "soak";
  int gpu = -1;
  bool progress = false;
};
/// `tetpbd soak`: a long run of a body at rest that must not drift, leak or slow down.
int run_soak(Scene scene, const SoakOptions& options);

// ------------------------------------------------------------------------------------------------------------
// what a run amounts to (statistics.cpp): stats.json and stats.csv, rows of sweeps

std::string csv_header();
std::string csv_row(const Measurement& measurement, const RunErrors& so_far);

/// A question about units where a mesh is larger than 50 m or smaller than 1 mm; else empty.
std::string question_units(const glm::dvec3& size);
/// s, with forces; 0 of what has none, and of meshes so large that it would take seconds to find.
double longest_stable_step(const ReferenceInput& input);
/// `mass` in kg.
ordered_json mesh_json(const MeshReport& report, double mass, double longest_stable_step, const Fit& fit);
ordered_json error_json(const RunErrors& errors);
/// Of an attachment, by number: what it holds, and what it bears now.
ordered_json attachment_json(const Sim& sim, std::size_t number, const State& state);
/// Of each body: what it is made of, and how it is now.
ordered_json bodies_json(const Sim& sim, const State& state);
/// The distance from a standard, "motion" or "total"; nulls where there is none, and of runs that are not finite.
ordered_json distance_json(const std::string& standard, const std::optional<MotionError>& error, bool finite);
/// {"step", "vertex"}, or null.
ordered_json non_finite_json(const std::optional<NonFinite>& found);
/// A state's hash as text; null where that is not finite.
ordered_json hash_json(const std::optional<std::uint64_t>& hash);
/// Puts into the row whether the run stayed finite, and says on standard error where not.
void put_finite(ordered_json& row, const MeasuredRun& run);
/// A run in a sweep: what tells its setting apart from others, errors, drifts, that.
ordered_json row_of(const Scene& scene, const Model& model, const Settings& settings, const MeasuredRun& run);

}  // namespace tetpbd
