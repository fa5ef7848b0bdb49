#include <fmt/chrono.h>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <array>
#include <cmath>
#include <ctime>
#include <fstream>
#include <limits>
#include <map>
#include <span>

#include "app/chart.h"
#include "app/files.h"
#include "app/lab.h"
#include "app/run_loop.h"
#include "render/renderer.h"
#include "render/target.h"
#include "sim/error.h"
#include "sim/gl/context.h"
#include "sim/interrupt.h"

namespace tetpbd {

namespace {

// The report; what stands in braces comes below.
constexpr const char* page = R"(<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>tetpbd: the paper's experiments</title><style>
body{{font-family:system-ui,sans-serif;max-width:960px;margin:2em auto;padding:0 1em}}
table{{border-collapse:collapse}}td,th{{border:1px solid #ccc;padding:.25em .6em;text-align:right}}
svg{{max-width:100%;height:auto}}img{{width:24%}}
</style></head><body>
<h1>The paper's experiments, measured here</h1>
<p>Va, Choi and Hong, <i>Efficient Simulation of Volumetric Deformable Objects in Unity3D: GPU-Accelerated
Position-Based Dynamics</i>, Electronics 2023, 12, 2229, measured with tetpbd. Device: <b>{device}</b>, OpenGL
{version}. Date: {date}. Command: <code>tetpbd reproduce{flag}</code>.{software}</p>
<h2>Table 4: the meshes</h2>
{meshes}
<p>V - E + F - T is 1 for a ball and 0 for our dragon, whose tail touches its back. The paper's dragon row gives 31709:
it cannot be one mesh. Our surfaces have the paper's vertex counts; TetGen fills them with other tets because the
triangles are not the same.</p>
<h2>What the paper does not state</h2>
<p>The drop height, the scale of the bodies and their masses. Here every body is 1 m high, of 1000 kg/m<sup>3</sup>
(with k = 1 the density changes nothing), time step 0.005 s, ω = 1.5, friction 0.5. The height above the ground and the
kind of mesh were searched for the smallest root mean square of ln(ours / published) over the five iteration counts
with all constraints, and nothing else.{quick}</p>
{falls}
{losses}
<p>The exact answer is 0: with k = 1 and all edges kept, only the rest shape meets every constraint. These curves are
what each number of iterations leaves undone.</p>
{snapshots}
{speeds}
<p>The paper measured inside Unity3D, where an empty scene reaches about 300 frames a second, so its ratios of GPU to
CPU saturate at 8 to 9. Here nothing but the work limits the rate. One Jacobi iteration does far less than one
Gauss-Seidel iteration: compare the losses in the same row before the rates.</p>
</body></html>
)";

constexpr std::array iteration_counts = {5, 10, 15, 20, 25};
const std::string all_kinds = "stretch,bend,volume";

// What the paper printed.
struct Published {
  const char *name, *scene;
  std::array<int, 6> mesh;  ///< table 4: vertices, surface triangles, stretch, bend, tets; V - E + F - T
  int losses_figure = 0, snapshots_figure = 0;
  float azimuth = 0;                            ///< degrees, of the snapshots' camera
  std::array<double, 5> stretch_bend{}, all{};  ///< the largest loss of volume, %, at iteration_counts
};
constexpr std::array published = {
    Published{"bunny",
              "bunny-drop",
              {2990, 5976, 16701, 8964, 10724, 1},
              8,
              9,
              -35,  //
              {64.66, 34.5, 20.79, 15.39, 12.31},
              {60.93, 31.10, 17.79, 13.34, 11.47}},
    Published{"armadillo",
              "armadillo-drop",
              {6362, 12720, 35442, 19080, 22721, 1},
              10,
              11,
              25,  //
              {86.95, 64.45, 51.11, 43.90, 42.47},
              {79.12, 53.03, 37.83, 32.19, 28.07}},
    Published{"dragon", "dragon-drop", {31800, 10582, 42072, 15419, 36690, 31709}},
};

/// How the falls were set up; the paper does not say.
struct Fall {
  const char* tetgen;
  double height;  ///< m, of the lowest point above the ground
};

/// What every part of the report is made with; each gives HTML and leaves a file beside it.
struct Report {
  std::filesystem::path out;
  bool quick = false;
  std::string broken{};                                    ///< what contradicts the paper's trends
  std::map<std::string, std::vector<MeasuredRun>> runs{};  ///< of fall_runs, so far
  /// Those that fall; the bunny alone, where it must be quick.
  std::span<const Published> models() const { return std::span(published).first(quick ? 1 : 2); }
  std::string figure(const std::string& name, const Chart& chart) const {
    const std::string svg = to_svg(chart);
    write_file(out / "figures" / (name + ".svg"), svg);
    return svg;
  }
  /// Rows are lists of as many values as there are columns.
  std::string table(const std::string& name, const std::string& columns, const ordered_json& rows) const {
    std::string csv = columns + "\n";
    std::string html = fmt::format("<tr><th>{}</th></tr>\n", fmt::join(split(columns, ','), "</th><th>"));
    for (const auto& row : rows) {
      std::vector<std::string> fields;
      for (const auto& value : row)
        fields.push_back(value.is_number_float() ? fmt::format("{:.5g}", value.get<double>())
                                                 : text_of(value));
      csv += fmt::format("{}\n", fmt::join(fields, ","));
      html += fmt::format("<tr><td>{}</td></tr>\n", fmt::join(fields, "</td><td>"));
    }
    write_file(out / "tables" / (name + ".csv"), csv);
    return "<table>\n" + html + "</table>\n";
  }
};

std::string base64(const std::string& bytes) {
  static constexpr char letters[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string result;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    unsigned value = 0;
    for (std::size_t k = 0; k < 3; ++k)
      value = value << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0u);
    for (std::size_t k = 0; k < 4; ++k)
      result += i + k > bytes.size() ? '=' : letters[value >> (18 - 6 * k) & 63];
  }
  return result;
}

Scene fall_scene(const Published& paper, const Fall& fall) {
  SceneOverrides overrides;
  overrides.tetgen = fall.tetgen;
  overrides.set = {fmt::format("bodies.0.position=[0,{},0]", fall.height)};
  overrides.parameters = {{"mode", "constraint"}};
  overrides.solver = "paper";
  return load_scene(paper.scene, overrides);
}

void check(const MeasuredRun& run, const Scene& scene) {
  if (interrupted()) throw Interrupted();
  if (run.errors.non_finite) throw error_of(*run.errors.non_finite, scene.name);
}

/// With each of the iteration counts.
const std::vector<MeasuredRun>& fall_runs(Report& report, const Published& paper, const Fall& fall,
                                          const std::string& kinds) {
  std::vector<MeasuredRun>& runs =
      report.runs[fmt::format("{} {} {} {}", paper.name, fall.tetgen, fall.height, kinds)];
  if (!runs.empty()) return runs;
  Scene scene = fall_scene(paper, fall);
  const auto model = build_model(scene);
  scene.settings.constraints = kinds;
  for (const int count : iteration_counts) {
    scene.settings.iterations = count;
    runs.push_back(run_model(model, scene.settings, report.quick ? 36 : 300));
    check(runs.back(), scene);
  }
  return runs;
}

std::string table_4(const Report& report) {
  ordered_json rows;
  for (const Published& paper : std::span(published).first(report.quick ? 1 : 3)) {
    std::string name = paper.name;
    name[0] = char(std::toupper(name[0]));
    ordered_json row = {name, "paper"};
    for (const int count : paper.mesh) row.push_back(count);
    rows.push_back(row);
    for (const char* switches : {"pY", "pYq1.85o/140"}) {
      const MeshReport mesh = tetpbd::report(load_mesh(load_scene(paper.scene).bodies[0].mesh, switches));
      rows.push_back({name, switches, mesh.vertices, mesh.surface_triangles, mesh.edges, mesh.bends,
                      mesh.tets, mesh.euler_characteristic});
    }
  }
  return report.table("table4", "model,source,vertices,surface triangles,stretch,bend,tets,V - E + F - T",
                      rows);
}

/// Nearest to the published losses with all constraints, over drop heights and kinds of mesh.
Fall nearest_fall(Report& report, std::string& html) {
  std::vector<Fall> falls;
  for (const char* mesh : {"pYq1.85o/140", "pY"})
    for (double height : {0.05, 1.0, 0.5, 0.2, 0.1, 0.02}) falls.push_back({mesh, height});
  if (report.quick) falls.resize(1);
  ordered_json rows;
  Fall best{};
  double least = std::numeric_limits<double>::infinity();
  Progress progress("drop heights", long(falls.size()));
  for (long done = 0; const Fall& fall : falls) {
    double sum = 0;
    for (const Published& paper : report.models()) {
      const std::vector<MeasuredRun>& runs = fall_runs(report, paper, fall, all_kinds);
      ordered_json row = {fall.tetgen, fall.height, paper.name};
      double own = 0;
      for (std::size_t k = 0; k < runs.size(); ++k) {
        row.push_back(runs[k].errors.max_volume_loss_percent);
        own += std::pow(std::log(runs[k].errors.max_volume_loss_percent / paper.all[k]), 2);
      }
      row.push_back(std::sqrt(own / double(runs.size())));
      rows.push_back(row);
      sum += own;
    }
    if (sum < least) least = sum, best = fall;
    progress.update(++done);
  }
  html = report.table("drop_heights", "mesh,height m,model,5,10,15,20,25,rms ln(ours/published)", rows) +
         fmt::format("<p><b>Nearest: meshes by TetGen {}, falling {} m.</b> The figures below use it.</p>\n",
                     best.tetgen, best.height);
  return best;
}

/// Figures 8 and 10.
std::string volume_error(Report& report, const Fall& fall, const Published& paper) {
  std::string html, broken;
  ordered_json rows;
  std::vector<double> losses;  // with stretch and bending, then with all constraints
  for (const bool with_volume : {false, true}) {
    Chart chart{fmt::format("{}: {}", paper.name, with_volume ? "all constraints" : "stretch and bending"),
                fmt::format("volume error over time; dashed: the published maxima. Constraint-centric "
                            "Jacobi, falling {} m",
                            fall.height),
                "time, s", "volume lost, %"};
    for (std::size_t k = 0;
         const MeasuredRun& run : fall_runs(report, paper, fall, with_volume ? all_kinds : "stretch,bend")) {
      const double printed = (with_volume ? paper.all : paper.stretch_bend)[k];
      losses.push_back(run.errors.max_volume_loss_percent);
      rows.push_back({with_volume ? "all" : "stretch+bend", iteration_counts[k], printed, losses.back(),
                      losses.back() / printed});
      Series series{
          fmt::format("{} iterations", iteration_counts[k]), palette_colour(k), {}, {}, true, false};
      for (const Measurement& m : run.measurements)
        series.x.push_back(m.time), series.y.push_back(-m.volume_error_percent);
      chart.series.push_back(series);
      series.name = fmt::format("published {:.1f} %", printed);
      series.y.assign(series.x.size(), printed);
      series.dashed = true;
      chart.series.push_back(series);
      ++k;
    }
    html += report.figure(fmt::format("volume_error_{}_{}", paper.name, with_volume ? "all" : "stretch_bend"),
                          chart);
  }
  const std::span without = std::span(losses).first(iteration_counts.size()),
                  with = std::span(losses).last(iteration_counts.size());
  for (std::size_t k = 0; k < with.size(); ++k) {
    const auto contradicts = [&](const char* what) {
      broken += fmt::format("{}: {} at {} iterations; ", paper.name, what, iteration_counts[k]);
    };
    if (k > 0 && !(with[k] < with[k - 1])) contradicts("more iterations do not lower the loss");
    if (!(with[k] < without[k])) contradicts("the volume constraint does not lower the loss");
  }
  const std::string verdict = broken.empty() ? "hold" : "do not hold: " + broken;
  fmt::print("{}: the paper's trends {}\n", paper.name, verdict);
  report.broken += broken;
  return fmt::format(
      "<h2>Figure {}: volume error over time, {}</h2>\n{}{}<p><b>The trends (more iterations lose less; the "
      "volume constraint lowers the loss) {}.</b></p>\n",
      paper.losses_figure, paper.name, html,
      report.table(fmt::format("volume_error_{}", paper.name),
                   "constraints,iterations,published %,ours %,ours / published", rows),
      verdict);
}

std::string snapshots(const Report& report, const Fall& fall, const Published& paper) {
  const Scene scene = fall_scene(paper, fall);
  const auto model = build_model(scene);
  Sim sim = create_sim(model, scene.settings);
  Renderer renderer = make_renderer(*model);
  const Target target = make_target(360, 300, 4);
  Camera camera;
  camera.azimuth = paper.azimuth;
  frame_box(camera, {-0.6f, 0, -0.6f}, {0.6f, float(1 + fall.height), 0.6f}, 1.2f, 1.0f);
  Frame frame = frame_of(sim, camera, {}, target);
  std::string html =
      fmt::format("<h2>Figure {}: snapshots, {}</h2>\n<p>All constraints, 25 iterations.</p>\n",
                  paper.snapshots_figure, paper.name);
  for (int s = 0; s <= (report.quick ? 25 : 150); s += 25) {
    if (s > 0) check(run_loop(sim, nullptr, 25), scene);
    frame.caption = fmt::format("t = {:.3f} s", s * scene.settings.dt);
    draw(renderer, frame);
    const auto file = report.out / "figures" / fmt::format("snapshot_{}_{:03}.png", paper.name, s);
    write_png(file, read_rgba(target));
    std::ifstream stream(file, std::ios::binary);
    html += fmt::format("<img alt=\"{} at step {}\" src=\"data:image/png;base64,{}\">\n", paper.name, s,
                        base64({std::istreambuf_iterator<char>(stream), {}}));
  }
  return html;
}

std::string speed(const Report& report, const BenchOptions& options, int figure, const std::string& name,
                  const std::string& what) {
  const ordered_json rows = run_sweep(bench_sweep(options))["rows"];
  if (interrupted()) throw Interrupted();
  std::string html = fmt::format("<h2>Figure {}: frames a second, {}</h2>\n", figure, what);
  ordered_json table;
  for (const bool rendered : {true, false}) {
    Chart chart{what,  rendered ? "with rendering at 640x480" : "simulation alone",
                "",    "frames a second (log)",
                false, true};
    chart.groups = options.scenes;
    for (const std::string& mode : options.axes.modes)
      chart.series.push_back({mode, mode_colour(mode), {}, {}});
    double first = 0;
    for (std::size_t r = rendered; r < rows.size(); r += 2) {  // a scene's modes, each alone, then rendered
      const ordered_json& row = rows[r];
      if (row["finite"] == false)
        throw Error("a state is not finite", fmt::format("figure {}", figure), "the line above says where",
                    1);
      const std::size_t mode = r / 2 % chart.series.size();
      const double fps = number(row, "fps");
      chart.series[mode].y.push_back(fps);
      if (mode == 0) first = fps;
      table.push_back({row["scene"], row["mode"], rendered ? row["size"] : "none", fps, fps / first,
                       cell(row, "gpu_ms_per_step"), cell(row, "wall_ms_per_step"),
                       cell(row, "max_volume_loss_percent")});
    }
    html += report.figure(name + (rendered ? "_rendered" : "_alone"), chart);
  }
  return html + report.table(name,
                             "scene,mode,size,fps,fps / fps of " + options.axes.modes[0] +
                                 ",GPU ms a step,wall ms a frame,volume loss %",
                             table);
}

std::string speeds(const Report& report) {
  BenchOptions bench;
  bench.sizes = {{640, 480}}, bench.pictures = {"full"};
  bench.repeats = report.quick ? 1 : 3;
  bench.most_seconds = report.quick ? 0.5 : 2;
  bench.axes.iterations = {1};
  if (report.quick) bench.scenes = {"bunny-drop"}, bench.frames = 10, bench.warm_up = 2;
  bench.axes.constraint_sets = {"stretch+bend"};
  std::string html = speed(report, bench, 6, "fps_stretch_bend", "1 iteration a frame, stretch and bending");
  bench.axes.constraint_sets = {"stretch+bend+volume"};
  html += speed(report, bench, 7, "fps_all", "1 iteration a frame, all constraints");
  bench.axes.iterations = {150};
  bench.axes.modes = {"constraint", "node"};
  if (report.quick) bench.frames = 1, bench.warm_up = 0;
  return html + speed(report, bench, 12, "fps_150", "150 iterations a frame, all constraints");
}

}  // namespace

int run_reproduce(const ReproduceOptions& options) {
  catch_interrupts();
  for (const char* folder : {"", "figures", "tables"}) make_output_folder(options.out / folder);
  HeadlessContext context(options.gpu);
  const Capabilities& device = context.capabilities();
  Report report{options.out, options.quick};
  const std::string meshes = table_4(report);
  std::string falls, losses, pictures;
  const Fall fall = nearest_fall(report, falls);
  for (const Published& paper : report.models()) {
    losses += volume_error(report, fall, paper);
    pictures += snapshots(report, fall, paper);
  }
  using fmt::arg;
  const std::string html = fmt::format(
      page, arg("device", device.renderer), arg("version", device.version),
      arg("date", fmt::format("{:%Y-%m-%d}", fmt::gmtime(std::time(nullptr)))),
      arg("flag", options.quick ? " --quick" : ""),
      arg("software",
          device.software ? " <b>A software renderer on a CPU: no time below is a GPU's.</b>" : ""),
      arg("quick", options.quick ? " <b>Quick: one fall, and a short one; only the trends count.</b>" : ""),
      arg("meshes", meshes), arg("falls", falls), arg("losses", losses), arg("snapshots", pictures),
      arg("speeds", speeds(report)));
  const std::filesystem::path file = options.out / "report.html";
  write_file(file, html);
  fmt::print("{}\n", file.string());
  if (!report.broken.empty())
    throw Error("a trend of the paper does not show", report.broken, "see " + file.string(), 1);
  return 0;
}

}  // namespace tetpbd
