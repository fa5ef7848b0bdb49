#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>

#include "app/commands.h"
#include "app/files.h"
#include "render/renderer.h"
#include "render/target.h"
#include "sim/error.h"
#include "sim/gl/context.h"

namespace tetpbd {

namespace {

const char* columns =
    "scene,mode,constraints,iterations,substeps,size,picture,vertices,tets,fps,gpu_ms_per_step,"
    "wall_ms_per_step,draw_ms,gpu_us_per_iteration,dispatches_per_step,gpu_bytes,max_volume_loss_percent,"
    "motion_final,motion_rms,motion_peak,motion_relative,state_hash,copies,"
    "copy_steps_per_second";
const char* table =
    "scene -16, mode -18, constraints -20, iterations:iter 5, substeps:sub 5, size 10, picture 8, fps 10, "
    "gpu_ms_per_step:GPU-ms 10, gpu_us_per_iteration:us/iter 10, draw_ms 10, "
    "max_volume_loss_percent:loss-% 11";

ordered_json spread(std::vector<double> values) {
  if (values.empty()) values = {0};
  return {{"median", median(values)}, {"min", percentile(values, 0)}, {"max", percentile(values, 1)}};
}

/// Frames as fast as they come: a step, and a picture of it if there is one. One wait, at the end.
void time_frames(ordered_json& row, Sim& sim, const BenchOptions& options, const std::function<void()>& picture) {
  std::vector<double> fps, gpu, wall;
  double drawing = 0, pictures = 0;
  RunPlan plan{.most_seconds = options.most_seconds, .pace = Pace::queued};
  if (picture) plan.stepped = [&](long) { picture(); };
  warm_up(sim);
  for (int repeat = 0; repeat < options.repeats && row["finite"] == true; ++repeat) {
    reset(sim);
    run_to_end(sim, nullptr, options.warm_up, plan);
    const auto begin = std::chrono::steady_clock::now();
    for (long f = 0; picture && f < std::min(options.frames, 200L); ++f, ++pictures) picture();
    glFinish();
    drawing += seconds_since(begin);
    const MeasuredRun run = run_to_end(sim, nullptr, options.frames, plan);
    fps.push_back(double(run.steps) / run.seconds);
    wall.push_back(run.seconds * 1e3 / double(run.steps));
    if (!run.gpu_ms.empty()) gpu.push_back(median(run.gpu_ms));
    put_finite(row, run);
  }
  if (row["finite"] == false) {  // the others say nothing
    fps = gpu = wall = {std::nan("")};
    row["max_volume_loss_percent"] = nullptr;
  }
  row["fps"] = spread(fps);
  row["copy_steps_per_second"] = row["copies"].get<int>() * number(row, "fps");
  row["gpu_ms_per_step"] = spread(gpu);
  row["wall_ms_per_step"] = spread(wall);
  row["draw_ms"] = picture ? 1e3 * drawing / pictures : std::nan("");
  row["gpu_us_per_iteration"] =
      1e3 * number(row, "gpu_ms_per_step") / (number(row, "iterations") * number(row, "substeps"));
}

std::vector<ordered_json> rows_of(const Scene& scene, const std::shared_ptr<const Model>& model,
                                  const Settings& settings, const BenchOptions& options) {
  Sim sim = create_sim(model, settings);
  const Explanation cost = explain(sim);
  Metrics metrics = create_metrics(sim);
  const auto right = right_motion(*model, settings);
  const MeasuredRun run =
      run_to_end(sim, &metrics, options.frames, {.most_seconds = 12 * options.most_seconds, .standard = right});
  ordered_json row = row_of(scene, *model, sim.settings, run);
  row.update({{"size", ""},
              {"picture", ""},
              {"dispatches_per_step", cost.dispatches_per_step},
              {"bytes_per_step", cost.bytes_per_step},
              {"gpu_bytes", cost.bytes},
              {"copies", scene.copies}});
  // Where time ran out: an error over part of the run would be another quantity.
  if (run.steps < options.frames) row["max_volume_loss_percent"] = nullptr;
  std::vector<ordered_json> rows{row};
  time_frames(rows[0], sim, options, {});
  if (options.sizes.empty()) return rows;
  Renderer renderer = make_renderer(*model);
  for (const auto& [width, height] : options.sizes) {
    const Target target = make_target(width, height, options.samples);
    const Camera camera = scene_camera(scene, *model, float(width) / float(height));
    for (const std::string& picture : options.pictures) {
      const auto kind = std::ranges::find(picture_kinds, picture, &PictureKind::name);
      const Frame frame = make_frame(sim, camera, kind->view, target);
      row["size"] = fmt::format("{}x{}", width, height);
      row["picture"] = picture;
      rows.push_back(row);
      time_frames(rows.back(), sim, options, [&] { draw(renderer, frame); });
    }
  }
  return rows;
}

}  // namespace

ordered_json launch_and_bandwidth_limits(bool software) {
  const std::size_t bytes = std::size_t(software ? 16 : 512) << 20, work_groups = bytes / 16 / 8 / 256;
  const Buffer from("probe, from", bytes), to("probe, to", bytes);
  from.clear();
  Recorder recorder;
  recorder.give("From", from), recorder.give("To", to);
  const auto seconds_each = [&](const char* copy, std::size_t groups, int times) {
    Pass pass{Program::compute("probe.comp", {{{"COPY", copy}}, {}}), groups};
    std::chrono::steady_clock::time_point begin;
    for (int k = -times; k < times; ++k) {  // the first half to warm up
      if (k == 0) {
        glFinish();
        begin = std::chrono::steady_clock::now();
      }
      recorder.run(pass);
    }
    glFinish();
    return seconds_since(begin) / times;
  };
  return {{"dispatch_us", seconds_each("0", 256, software ? 20 : 5000) * 1e6},
          {"copy_gb_s", 2 * double(bytes) / seconds_each("1", work_groups, software ? 2 : 50) * 1e-9}};
}

Sweep bench_sweep(const BenchOptions& options) {
  Sweep sweep{"bench", "bench", split(columns, ','), {}, table, {}};
  for (const std::string& name : options.scenes) {
    const Scene scene = load_scene(name, options.overrides);
    const auto all = without_repeats(combine(scene.settings, options.variations));
    const auto model = build_model(scene);
    for (const Settings& settings : all) sweep.work.push_back([=] { return rows_of(scene, model, settings, options); });
  }
  return sweep;
}

int run_bench(const BenchOptions& options) {
  make_output_folder(options.out);
  HeadlessContext context(options.gpu);
  Sweep sweep = bench_sweep(options);
  const ordered_json limits = launch_and_bandwidth_limits(context.capabilities().software);
  sweep.facts = {{"device", device_json(context.capabilities())},
                 {"frames", options.frames},
                 {"warm_up", options.warm_up},
                 {"repeats", options.repeats},
                 {"floors", limits}};
  sweep.print_each = true;
  fmt::print(
      "{} frames after {} to warm up, {} times, medians; one step of the scene's dt a frame, nothing waits "
      "between frames\nat least {:.2f} us a dispatch with its barrier, {:.0f} GB/s copied\n",
      options.frames, options.warm_up, options.repeats, number(limits, "dispatch_us"), number(limits, "copy_gb_s"));
  print_table(sweep, sweep.facts);
  return write_sweep(sweep, options.out, run_sweep(sweep, {}, options.out));
}

}  // namespace tetpbd
