#include <fmt/chrono.h>
#include <fmt/format.h>

#include <array>
#include <cmath>
#include <ctime>
#include <fstream>
#include <limits>
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
body{{font-family:system-ui,sans-serif;max-width:960px;margin:2em auto;padding:0 1em;color:#222}}
table{{border-collapse:collapse;margin:1em 0}}
td,th{{border:1px solid #ccc;padding:.25em .6em;text-align:right;font-variant-numeric:tabular-nums}}
th{{background:#f3f3f3}}figure{{margin:1em 0}}svg{{max-width:100%;height:auto}}.row img{{width:24%;min-width:180px}}
</style></head><body>
<h1>The paper's experiments, measured here</h1>
<p>The experiments of Va, Choi and Hong, <i>Efficient Simulation of Volumetric Deformable Objects in Unity3D:
GPU-Accelerated Position-Based Dynamics</i>, Electronics 2023, 12, 2229, measured with tetpbd. Device: <b>{device}</b>,
OpenGL {version}. Date: {date}. Command: <code>tetpbd reproduce{flag}</code>.{software}</p>
<h2>Table 4: the meshes</h2>
{meshes}
<p>V - E + F - T is 1 for a ball and 0 for our dragon, whose tail touches its back. The paper's dragon row gives 31709:
it cannot be one mesh. Our surfaces have the paper's vertex counts; TetGen fills them with other tets because the
triangles are not the same.</p>
<h2>What the paper does not state</h2>
<p>The drop height, the scale of the bodies and their masses. Here every body is 1 m high, of 1000 kg/m<sup>3</sup>
(with k = 1 the density changes nothing), time step 0.005 s, ω = 1.5, friction 0.5.</p>
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
constexpr const char* quick_fall =
    "<p><b>Quick: nothing is searched.</b> The bunny falls 0.05 m for a short time, so losses are smaller "
    "than "
    "published; only the trends count.</p>";
constexpr const char* nearest =
    "<p>The height above the ground and the kind of mesh were searched for the smallest root mean square of "
    "ln(ours / published) over the five iteration counts with all constraints; nothing else was fitted.</p>{}"
    "<p><b>Nearest: meshes by TetGen {}, falling {} m</b> (rms {:.3f} over both models). The figures below "
    "use "
    "it.</p>";

constexpr std::array iteration_counts = {5, 10, 15, 20, 25};

// What the paper printed. Losses: the largest of the volume, %, at iteration_counts.
struct Published {
  const char *name, *scene;
  int losses_figure, snapshots_figure;
  float azimuth;  ///< degrees, of the snapshots' camera
  std::array<double, 5> stretch_bend, all;
};
constexpr Published published[] = {
    {"bunny",
     "bunny-drop",
     8,
     9,
     -35,
     {64.66, 34.5, 20.79, 15.39, 12.31},
     {60.93, 31.10, 17.79, 13.34, 11.47}},
    {"armadillo",
     "armadillo-drop",
     10,
     11,
     25,
     {86.95, 64.45, 51.11, 43.90, 42.47},
     {79.12, 53.03, 37.83, 32.19, 28.07}},
};
struct PublishedMesh {  // table 4
  const char *name, *scene;
  std::size_t vertices, triangles, stretch, bend, tets;
};
constexpr PublishedMesh published_meshes[] = {
    {"Bunny", "bunny-drop", 2990, 5976, 16701, 8964, 10724},
    {"Armadillo", "armadillo-drop", 6362, 12720, 35442, 19080, 22721},
    {"Dragon", "dragon-drop", 31800, 10582, 42072, 15419, 36690},
};

/// How the falls were set up; the paper does not say.
struct Fall {
  std::string tetgen;
  double height = 1;  ///< m, of the lowest point above the ground
};

using Row = std::vector<std::string>;

/// Each gives HTML, and leaves a file beside it.
struct Report {
  std::filesystem::path out;
  bool quick = false;
  /// The bunny alone, where it must be quick.
  template <class T>
  std::span<const T> some(std::span<const T> all) const {
    return quick ? all.first(1) : all;
  }
  long steps() const { return quick ? 50 : 300; }
  std::string figure(const std::string& name, const Chart& chart) const {
    const std::string svg = to_svg(chart);
    write_file(out / "figures" / (name + ".svg"), svg);
    return "<figure>" + svg + "</figure>\n";
  }
  /// The first row is the header.
  std::string table(const std::string& name, const std::vector<Row>& rows) const {
    std::string csv, html;
    for (const Row& row : rows) {
      const char* cell = &row == &rows.front() ? "th" : "td";
      csv += fmt::format("{}\n", fmt::join(row, ","));
      html +=
          fmt::format("<tr><{0}>{1}</{0}></tr>\n", cell, fmt::join(row, fmt::format("</{0}><{0}>", cell)));
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

Scene fall_scene(const char* name, const Fall& fall) {
  SceneOverrides overrides;
  overrides.tetgen = fall.tetgen;
  overrides.set = {fmt::format("bodies.0.position=[0,{},0]", fall.height)};
  overrides.parameters = {{"mode", "constraint"}};
  overrides.solver = "paper";
  return load_scene(name, overrides);
}

MeasuredRun fall_run(const Scene& scene, const std::shared_ptr<const Model>& model, const char* kinds,
                     int iterations, long steps) {
  Settings settings = scene.settings;
  settings.constraints = kinds;
  settings.iterations = iterations;
  Sim sim = create_sim(model, settings);
  Metrics metrics = create_metrics(*model, sim.system);
  MeasuredRun run = run_loop(sim, &metrics, steps);
  if (interrupted()) throw Interrupted();
  if (run.errors.non_finite)
    throw error_of(*run.errors.non_finite,
                   fmt::format("{}, {}, {} iterations", scene.name, kinds, iterations));
  return run;
}

std::string percent(double value) { return fmt::format("{:.2f}", value); }

std::string table_4(const Report& report) {
  std::vector<Row> rows = {
      {"model", "source", "vertices", "surface triangles", "stretch", "bend", "tets", "V - E + F - T"}};
  for (const PublishedMesh& paper : report.some<PublishedMesh>(published_meshes)) {
    const auto add = [&](const char* source, std::size_t v, std::size_t b, std::size_t e, std::size_t bends,
                         std::size_t t) {
      const auto characteristic = long(v) - long(e) + long(4 * t + b) / 2 - long(t);
      rows.push_back({paper.name, source});
      for (long count : {long(v), long(b), long(e), long(bends), long(t), characteristic})
        rows.back().push_back(std::to_string(count));
    };
    add("paper", paper.vertices, paper.triangles, paper.stretch, paper.bend, paper.tets);
    for (const char* switches : {"pY", "pYq1.85o/140"}) {
      const MeshReport mesh = tetpbd::report(load_mesh(load_scene(paper.scene).bodies[0].mesh, switches));
      add(switches, mesh.vertices, mesh.surface_triangles, mesh.edges, mesh.bends, mesh.tets);
    }
  }
  return report.table("table4", rows);
}

/// Nearest to the published losses with all constraints, over drop heights and kinds of mesh.
Fall nearest_fall(const Report& report, std::string& html) {
  std::vector<Fall> falls = {{"pYq1.85o/140", 0.05}};
  if (!report.quick) {
    falls.clear();
    for (const char* mesh : {"pY", "pYq1.85o/140"})
      for (double height : {1.0, 0.5, 0.2, 0.1, 0.05, 0.02}) falls.push_back({mesh, height});
  }
  std::vector<Row> rows = {
      {"mesh", "height m", "model", "5", "10", "15", "20", "25", "rms ln(ours/published)"}};
  const auto models = report.some<Published>(published);
  constexpr auto counts = double(iteration_counts.size());
  Fall best;
  double least = std::numeric_limits<double>::infinity();
  Progress progress("drop heights", long(falls.size() * models.size() * iteration_counts.size()));
  long done = 0;
  for (const Fall& fall : falls) {
    double sum = 0;
    for (const Published& paper : models) {
      const Scene scene = fall_scene(paper.scene, fall);
      const auto model = build_model(scene);
      Row row = {fall.tetgen, fmt::format("{}", fall.height), paper.name};
      double own = 0;
      for (std::size_t k = 0; k < iteration_counts.size(); ++k) {
        const MeasuredRun run =
            fall_run(scene, model, "stretch,bend,volume", iteration_counts[k], report.steps());
        const double loss = run.errors.max_volume_loss_percent;
        row.push_back(percent(loss));
        own += std::pow(std::log(loss / paper.all[k]), 2);
        progress.update(++done);
      }
      sum += own;
      row.push_back(fmt::format("{:.3f}", std::sqrt(own / counts)));
      rows.push_back(row);
    }
    const double rms = std::sqrt(sum / (counts * double(models.size())));
    if (rms < least) least = rms, best = fall;
  }
  const std::string table = report.table("drop_heights", rows);
  html = report.quick ? quick_fall + table
                      : fmt::format(fmt::runtime(nearest), table, best.tetgen, best.height, least);
  return best;
}

/// Figures 8 and 10; adds to `broken` what contradicts the paper's trends.
std::string volume_error(const Report& report, const Fall& fall, const Published& paper,
                         std::string& all_broken) {
  std::string html =
      fmt::format("<h2>Figure {}: volume error over time, {}</h2>\n", paper.losses_figure, paper.name);
  const Scene scene = fall_scene(paper.scene, fall);
  const auto model = build_model(scene);
  std::vector<Row> rows = {{"constraints", "iterations", "published %", "ours %", "ours / published"}};
  std::string broken;
  std::array<double, 5> without{};
  for (const bool with_volume : {false, true}) {
    Chart chart{fmt::format("{}: {}", paper.name, with_volume ? "all constraints" : "stretch and bending"),
                fmt::format("volume error over time; dashed: the published maxima. {} tets, "
                            "constraint-centric Jacobi, falling {} m",
                            model->rest.tets.size(), fall.height),
                "time, s", "volume lost, %"};
    double before = std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k < iteration_counts.size(); ++k) {
      const int count = iteration_counts[k];
      const double printed = with_volume ? paper.all[k] : paper.stretch_bend[k];
      const MeasuredRun run =
          fall_run(scene, model, with_volume ? "stretch,bend,volume" : "stretch,bend", count, report.steps());
      Series series{fmt::format("{} iterations", count), palette_colour(k), {}, {}, true, false};
      for (const Measurement& m : run.measurements)
        series.x.push_back(m.time), series.y.push_back(-m.volume_error_percent);
      chart.series.push_back(series);
      chart.series.push_back({fmt::format("published {:.1f} %", printed),
                              palette_colour(k),
                              {series.x.front(), series.x.back()},
                              {printed, printed},
                              true,
                              false,
                              true});
      const double loss = run.errors.max_volume_loss_percent;
      rows.push_back({with_volume ? "all" : "stretch+bend", std::to_string(count), percent(printed),
                      percent(loss), fmt::format("{:.2f}", loss / printed)});
      if (with_volume && !(loss < before))
        broken += fmt::format("{}: loss does not fall from {} to {} iterations; ", paper.name,
                              iteration_counts[k - 1], count);
      if (with_volume && !(loss < without[k]))
        broken += fmt::format("{}: the volume constraint does not lower the loss at {} iterations; ",
                              paper.name, count);
      before = loss;
      if (!with_volume) without[k] = loss;
    }
    html += report.figure(fmt::format("volume_error_{}_{}", paper.name, with_volume ? "all" : "stretch_bend"),
                          chart);
  }
  const std::string verdict = broken.empty() ? "hold" : "do not hold: " + broken;
  fmt::print("{}: the paper's trends {}\n", paper.name, verdict);
  all_broken += broken;
  return html + report.table(fmt::format("volume_error_{}", paper.name), rows) +
         fmt::format(
             "<p><b>{}: the trends (more iterations lose less; the volume constraint lowers the loss) "
             "{}.</b></p>\n",
             paper.name, verdict);
}

std::string snapshots(const Report& report, const Fall& fall, const Published& paper) {
  const Scene scene = fall_scene(paper.scene, fall);
  const auto model = build_model(scene);
  Sim sim = create_sim(model, scene.settings);
  Renderer renderer = make_renderer(*model);
  const Target target = make_target(360, 300, 4);
  Camera camera;
  camera.azimuth = paper.azimuth;
  frame_box(camera, {-0.6f, 0, -0.6f}, {0.6f, float(1 + fall.height), 0.6f}, 1.2f, 1.0f);
  Frame frame = frame_of(sim, camera, {}, target);
  std::string html = fmt::format(
      "<h2>Figure {}: snapshots, {}</h2>\n<p>All constraints, 25 iterations.</p>\n<div class=\"row\">",
      paper.snapshots_figure, paper.name);
  const auto snapshot = [&](long s) {
    if (s % 25) return true;
    frame.caption = fmt::format("t = {:.3f} s", double(s) * scene.settings.dt);
    draw(renderer, frame);
    const auto file = report.out / "figures" / fmt::format("snapshot_{}_{:03}.png", paper.name, s);
    write_png(file, read_rgba(target));
    std::ifstream stream(file, std::ios::binary);
    html += fmt::format("<img alt=\"{} at step {}\" src=\"data:image/png;base64,{}\">\n", paper.name, s,
                        base64({std::istreambuf_iterator<char>(stream), {}}));
    return true;
  };
  snapshot(0);
  const MeasuredRun run = run_loop(sim, nullptr, 150, {.stepped = snapshot});
  if (interrupted()) throw Interrupted();
  if (run.errors.non_finite) throw error_of(*run.errors.non_finite, scene.name);
  return html + "</div>\n";
}

std::string speed(const Report& report, const BenchOptions& options, int figure, const std::string& name,
                  const std::string& what) {
  std::string html = fmt::format("<h2>Figure {}: frames a second, {}</h2>\n", figure, what);
  const ordered_json rows = run_sweep(bench_sweep(options))["rows"];
  if (interrupted()) throw Interrupted();
  for (const auto& row : rows)
    if (row["finite"] == false)
      throw Error("a state is not finite", fmt::format("figure {}", figure), "the line above says where", 1);
  std::vector<Row> table = {
      {"scene", "mode", "size", "fps", "fps / cpu", "GPU ms a step", "wall ms a frame", "volume loss %"}};
  const auto written = [](const char* format, double value) {
    return std::isfinite(value) ? fmt::format(fmt::runtime(format), value) : "";
  };
  for (const bool rendered : {true, false}) {
    Chart chart{what,
                rendered ? fmt::format("with rendering at {}x{}", options.sizes[0][0], options.sizes[0][1])
                         : "simulation alone",
                "",
                "frames a second (log)",
                false,
                true};
    chart.groups = options.scenes;
    for (const std::string& mode : options.modes) {
      Series bars{mode, mode_colour(mode), {}, {}};
      for (const std::string& scene : options.scenes) {
        const auto row_of = [&](const std::string& of) {
          for (const auto& row : rows)
            if (row["scene"] == scene && row["mode"] == of && (row["size"] != "") == rendered) return row;
          return ordered_json{{"fps", nullptr}};
        };
        const ordered_json row = row_of(mode);
        bars.y.push_back(number(row, "fps"));
        const double loss = options.frames < 100 ? std::nan("") : number(row, "max_volume_loss_percent");
        table.push_back({scene, mode, rendered ? text_of(row["size"]) : "none",
                         written("{:.1f}", bars.y.back()),
                         written("{:.1f}", bars.y.back() / number(row_of("cpu"), "fps")),
                         written("{:.4f}", number(row, "gpu_ms_per_step")),
                         written("{:.4f}", number(row, "wall_ms_per_step")), written("{:.2f}", loss)});
      }
      chart.series.push_back(bars);
    }
    html += report.figure(name + (rendered ? "_rendered" : "_alone"), chart);
  }
  return html + report.table(name, table);
}

std::string speeds(const Report& report) {
  BenchOptions bench;
  bench.sizes = {{640, 480}}, bench.pictures = {"full"};
  bench.repeats = report.quick ? 1 : 3;
  bench.most_seconds = report.quick ? 0.5 : 2;
  bench.iterations = {1};
  if (report.quick) bench.scenes = {"bunny-drop"}, bench.frames = 10, bench.warm_up = 2;
  bench.constraint_sets = {"stretch+bend"};
  std::string html = speed(report, bench, 6, "fps_stretch_bend", "1 iteration a frame, stretch and bending");
  bench.constraint_sets = {"stretch+bend+volume"};
  html += speed(report, bench, 7, "fps_all", "1 iteration a frame, all constraints");
  bench.iterations = {150};
  bench.modes = {"constraint", "node"};
  if (report.quick) bench.frames = 3, bench.warm_up = 0;
  return html + speed(report, bench, 12, "fps_150", "150 iterations a frame, all constraints");
}

}  // namespace

int run_reproduce(const ReproduceOptions& options) {
  catch_interrupts();
  for (const char* folder : {"", "figures", "tables"}) make_output_folder(options.out / folder);
  HeadlessContext context(options.gpu);
  const Capabilities& device = context.capabilities();
  const Report report{options.out, options.quick};
  const auto models = report.some<Published>(published);
  const std::string meshes = table_4(report);
  std::string falls, losses, pictures, broken;
  const Fall fall = nearest_fall(report, falls);
  for (const Published& paper : models) losses += volume_error(report, fall, paper, broken);
  for (const Published& paper : models) pictures += snapshots(report, fall, paper);
  const std::string rates = speeds(report);
  const char* software =
      device.software ? " <b>This is a software renderer on a CPU: no time below is a GPU's.</b>" : "";
  const std::filesystem::path file = options.out / "report.html";
  using fmt::arg;
  write_file(file, fmt::format(page, arg("device", device.renderer), arg("version", device.version),
                               arg("date", fmt::format("{:%Y-%m-%d}", fmt::gmtime(std::time(nullptr)))),
                               arg("flag", options.quick ? " --quick" : ""), arg("software", software),
                               arg("meshes", meshes), arg("falls", falls), arg("losses", losses),
                               arg("snapshots", pictures), arg("speeds", rates)));
  fmt::print("{}\n", file.string());
  if (!broken.empty()) throw Error("a trend of the paper does not show", broken, "see " + file.string(), 1);
  return 0;
}

}  // namespace tetpbd
