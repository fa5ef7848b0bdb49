#include "app/bench.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <numeric>

#include "app/files.h"
#include "app/floors.h"
#include "app/measure_run.h"
#include "app/progress.h"
#include "render/target.h"
#include "sim/error.h"
#include "sim/gl/context.h"
#include "sim/interrupt.h"

namespace tetpbd {

namespace {

using Clock = std::chrono::steady_clock;

Percentiles spread(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return {values[values.size() / 2], values.front(), values.back()};
}

void mark_non_finite(BenchRow& row, const NonFinite& found) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  row.non_finite = found;
  row.fps = row.gpu_ms = row.wall_ms = {nan, nan, nan};
  row.max_volume_loss_percent = nan;
}

/// Frames as fast as they come: a step, and a picture of it if there is a target. One wait, at the end.
void time_frames(BenchRow& row, Sim& sim, const BenchOptions& options, Renderer* renderer,
                 const Frame& view) {
  std::vector<double> fps, gpu, wall, still;
  warm_up(sim);
  for (int repeat = 0; repeat < options.repeats; ++repeat) {
    reset(sim);
    sim.timed = false;
    const auto picture = [&] {
      if (renderer) draw(*renderer, view);
    };
    const auto frame = [&] {
      step(sim);
      picture();
    };
    const auto time_picture = [&] {
      if (!renderer) return;
      const auto begin = Clock::now();
      const long count = std::min(options.frames, 100L);
      for (long f = 0; f < count; ++f) picture();
      glFinish();
      still.push_back(std::chrono::duration<double, std::milli>(Clock::now() - begin).count() /
                      double(count));
    };
    for (long f = 0; f < options.warm_up && !interrupted(); ++f) frame();
    glFinish();
    time_picture();
    sim.timed = true;
    std::vector<double> steps;
    const auto begin = Clock::now();
    const auto elapsed = [&] { return std::chrono::duration<double>(Clock::now() - begin).count(); };
    long frames = 0;
    for (; frames < options.frames && elapsed() < options.most_seconds; ++frames) {
      if (interrupted()) throw Interrupted();
      frame();
      while (const auto ms = sim.timer.poll()) steps.push_back(*ms);
    }
    glFinish();
    const double seconds = elapsed();
    while (const auto ms = sim.timer.poll(true)) steps.push_back(*ms);
    if (check_finite(sim, true)) return mark_non_finite(row, *sim.check.found);
    fps.push_back(double(frames) / seconds);
    wall.push_back(seconds * 1e3 / double(frames));
    if (!steps.empty()) gpu.push_back(percentiles(steps).median);
    time_picture();
  }
  if (!still.empty()) row.draw_ms = std::accumulate(still.begin(), still.end(), 0.0) / double(still.size());
  row.fps = spread(fps);
  row.wall_ms = spread(wall);
  if (!gpu.empty()) row.gpu_ms = spread(gpu);
}

std::string csv_line(const BenchRow& r) {
  const auto number = [](double value, bool known = true) {
    return known && std::isfinite(value) ? fmt::format("{:.6g}", value) : std::string();
  };
  const bool on_gpu = r.gpu_ms.median > 0;
  return fmt::format("{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{}\n", csv_field(r.scene), r.mode,
                     r.constraints, r.iterations, r.substeps, r.size, r.picture, r.vertices, r.tets,
                     number(r.fps.median), number(r.gpu_ms.median, on_gpu), number(r.wall_ms.median),
                     number(r.draw_ms, r.draw_ms > 0),
                     number(1e3 * r.gpu_ms.median / r.iterations / r.substeps, on_gpu), r.dispatches,
                     r.gpu_bytes, number(r.max_volume_loss_percent));
}

std::string kinds_of(std::string set) {
  std::replace(set.begin(), set.end(), '+', ',');
  return set;
}

// Over the same frames, but NaN where time ran out: an error over part of the run would be another quantity.
void error_run(BenchRow& row, Sim& sim, const Model& model, const BenchOptions& options) {
  Metrics metrics = create_metrics(model, sim.system);
  const auto begin = Clock::now();
  bool whole = true;
  const MeasuredRun run = measure_run(sim, metrics, options.frames, [&](long) {
    return whole = std::chrono::duration<double>(Clock::now() - begin).count() < 12 * options.most_seconds;
  });
  row.max_volume_loss_percent = whole ? run.errors.max_volume_loss_percent : std::nan("");
  if (run.errors.non_finite) mark_non_finite(row, *run.errors.non_finite);
}

}  // namespace

std::vector<BenchRow> bench_rows(const BenchOptions& options,
                                 const std::function<void(const BenchRow&)>& report) {
  std::vector<std::pair<Scene, std::shared_ptr<const Model>>> scenes;
  for (const std::string& name : options.scenes) {
    Scene scene = load_scene(name, options.overrides);
    for (const std::string& mode : options.modes) set_mode(scene.settings, mode, "--modes");
    for (const std::string& set : options.constraint_sets)
      set_parameter(scene.settings, *find_parameter("constraints"), kinds_of(set), "--constraint-sets");
    auto model = build_model(scene);
    scenes.emplace_back(std::move(scene), std::move(model));
  }
  std::vector<BenchRow> rows;
  Progress progress("bench", long(scenes.size() * options.modes.size() * options.constraint_sets.size() *
                                  options.iterations.size() * options.substeps.size()));
  long done = 0;
  for (const auto& [scene, model] : scenes) {
    std::optional<Renderer> renderer;
    if (!options.sizes.empty()) renderer = make_renderer(model->rest);
    for (const std::string& set : options.constraint_sets)
      for (const std::string& mode : options.modes)
        for (int iterations : options.iterations)
          for (int substeps : options.substeps) {
            Settings settings = scene.settings;
            settings.constraints = kinds_of(set);
            set_mode(settings, mode, "--modes");
            settings.iterations = iterations;
            settings.substeps = substeps;
            Sim sim = create_sim(model, settings);
            const Explanation cost = explain(sim);
            BenchRow row;
            row.scene = scene.name, row.mode = mode, row.constraints = set;
            row.iterations = iterations, row.substeps = substeps;
            row.omega = effective_omega(settings);
            row.vertices = model->positions.size(), row.tets = model->rest.tets.size();
            row.gpu_bytes = cost.bytes, row.dispatches = cost.dispatches_per_step;
            row.bytes_per_step = cost.bytes_per_step;
            error_run(row, sim, *model, options);
            const auto add = [&](Renderer* drawn_by, const Frame& view) {
              if (!row.non_finite) time_frames(row, sim, options, drawn_by, view);
              rows.push_back(row);
              if (report) report(row);
            };
            add(nullptr, {});
            for (const auto& [width, height] : options.sizes) {
              const Target target = make_target(width, height, options.samples);
              const Camera camera = scene_camera(scene, *model, float(width) / float(height));
              for (const std::string& picture : options.pictures) {
                row.size = fmt::format("{}x{}", width, height);
                row.picture = picture;
                const ViewOptions look = picture == "plain" ? plain_view({}) : ViewOptions{};
                add(&*renderer, frame_of(sim, camera, look, target));
              }
            }
            progress.update(++done);
          }
  }
  return rows;
}

std::string bench_csv(const std::vector<BenchRow>& rows) {
  std::string csv =
      "scene,mode,constraints,iterations,substeps,size,picture,vertices,tets,fps,gpu_ms_per_step,wall_ms_per_"
      "step,draw_ms,"
      "gpu_us_per_iteration,dispatches_per_step,gpu_bytes,max_volume_loss_percent\n";
  for (const BenchRow& row : rows) csv += csv_line(row);
  return csv;
}

int run_bench(const BenchOptions& options) {
  catch_interrupts();
  make_output_folder(options.out);
  HeadlessContext context(options.gpu);
  const Capabilities& device = context.capabilities();
  fmt::print(
      "{}{}\n{} frames after {} to warm up, {} times, medians; one step of the scene's dt a frame, nothing "
      "waits between frames\n",
      device.renderer,
      device.software ? ": a SOFTWARE renderer on the CPU. These are not a GPU's numbers."
                      : ", OpenGL " + device.version,
      options.frames, options.warm_up, options.repeats);
  const Floors floors = measure_floors(device.software);
  fmt::print("floors: {:.2f} us a dispatch with its barrier, {:.0f} GB/s copied\n\n", floors.dispatch_us,
             floors.copy_gb_s);
  fmt::print("{:<16}{:<14}{:<22}{:>5}{:>5}{:>16}{:>11}{:>11}{:>10}{:>11}{:>11}\n", "scene", "mode",
             "constraints", "iter", "sub", "picture", "fps", "GPU us", "us/iter", "draw us", "loss %");
  std::vector<BenchRow> rows;
  const auto report = [&](const BenchRow& row) {
    rows.push_back(row);
    const auto gpu = [&](double value) {
      return row.gpu_ms.median > 0 ? fmt::format("{:.1f}", value) : std::string("-");
    };
    const std::string fps = row.non_finite ? "-" : fmt::format("{:.1f}", row.fps.median);
    fmt::print("{:<16}{:<14}{:<22}{:>5}{:>5}{:>16}{:>11}{:>11}{:>10}{:>11}{:>11}\n", row.scene, row.mode,
               row.constraints, row.iterations, row.substeps,
               row.size.empty() ? "none" : row.size + " " + row.picture, fps, gpu(1e3 * row.gpu_ms.median),
               gpu(1e3 * row.gpu_ms.median / row.iterations / row.substeps),
               row.draw_ms > 0 ? fmt::format("{:.1f}", 1e3 * row.draw_ms) : "-",
               std::isfinite(row.max_volume_loss_percent) ? fmt::format("{:.2f}", row.max_volume_loss_percent)
                                                          : "-");
    std::fflush(stdout);
  };
  bool whole = true;
  try {
    bench_rows(options, report);
  } catch (const Interrupted&) {
    whole = false;
  }
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  const auto triple = [](const Percentiles& p) {
    return nlohmann::ordered_json{{"median", p.median}, {"min", p.p05}, {"max", p.p95}};
  };
  for (const BenchRow& r : rows) {
    nlohmann::ordered_json loss;  // null; so is what is not a number below
    if (std::isfinite(r.max_volume_loss_percent)) loss = r.max_volume_loss_percent;
    list.push_back({{"scene", r.scene},
                    {"mode", r.mode},
                    {"omega", r.omega},
                    {"constraints", r.constraints},
                    {"iterations", r.iterations},
                    {"substeps", r.substeps},
                    {"size", r.size},
                    {"picture", r.picture},
                    {"vertices", r.vertices},
                    {"tets", r.tets},
                    {"fps", triple(r.fps)},
                    {"gpu_ms_per_step", triple(r.gpu_ms)},
                    {"wall_ms_per_step", triple(r.wall_ms)},
                    {"draw_ms", r.draw_ms > 0 ? nlohmann::ordered_json(r.draw_ms) : nlohmann::ordered_json()},
                    {"dispatches_per_step", r.dispatches},
                    {"bytes_per_step", r.bytes_per_step},
                    {"gpu_bytes", r.gpu_bytes},
                    {"max_volume_loss_percent", loss},
                    {"finite", !r.non_finite},
                    {"non_finite", non_finite_json(r.non_finite)}});
  }
  write_file(options.out / "bench.csv", bench_csv(rows));
  const nlohmann::ordered_json document = {
      {"device", device_json(device)},
      {"frames", options.frames},
      {"warm_up", options.warm_up},
      {"repeats", options.repeats},
      {"floors", {{"dispatch_us", floors.dispatch_us}, {"copy_gb_s", floors.copy_gb_s}}},
      {"rows", list}};
  write_file(options.out / "bench.json", json_text(document, 1) + "\n");
  fmt::print("\n{}\n", (options.out / "bench.csv").string());
  for (const BenchRow& r : rows)
    if (r.non_finite)
      throw error_of(*r.non_finite, fmt::format("{}, mode {}, {}, {} iterations, {} substeps", r.scene,
                                                r.mode, r.constraints, r.iterations, r.substeps));
  if (!whole)
    throw Error("interrupted", fmt::format("after {} rows", rows.size()), "what was finished is written", 1);
  return 0;
}

}  // namespace tetpbd
