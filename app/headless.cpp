#include "app/headless.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>

#include "app/auto_solver.h"
#include "app/files.h"
#include "app/progress.h"
#include "app/statistics.h"
#include "render/target.h"
#include "sim/error.h"
#include "sim/gl/context.h"
#include "sim/interrupt.h"
#include "sim/metrics.h"

namespace tetpbd {

namespace {

/// Draws what a run asked for and writes it as it arrives.
struct FrameWriter {
  const RunOptions& options;
  Camera camera;
  Renderer renderer;
  Target target;
  long drawn = 0;  ///< step of the last frame
  std::optional<Video> video;
  ReadBack read_back;
  struct Use {
    long png_step;
    bool video;
  };
  std::deque<Use> uses;

  FrameWriter(const RunOptions& run, Camera view, Renderer with, Target to)
      : options(run), camera(view), renderer(std::move(with)), target(std::move(to)) {}

  void draw_frame(const Sim& sim, long png_step, bool to_video) {
    draw(renderer, frame_of(sim, camera, options.view, target));
    if (const auto centre = poll_centre(renderer, true))  // for the next frame
      follow(camera, *centre, float(double(sim.steps - drawn) * sim.settings.dt));
    drawn = sim.steps;
    read_back.push(target);
    uses.push_back({png_step, to_video});
    while (uses.size() > 2) write_one(true);
  }

  bool write_one(bool wait) {
    const auto image = read_back.poll(wait);
    if (!image) return false;
    const Use use = uses.front();
    uses.pop_front();
    if (use.png_step >= 0) write_png(options.out / fmt::format("frame_{:05}.png", use.png_step), *image);
    if (use.video) video->add(*image);
    return true;
  }

  void finish() {
    while (!uses.empty() && write_one(true)) {
    }
    if (video) video->close();
  }
};

}  // namespace

int run_headless(Scene scene, const RunOptions& options) {
  using Clock = std::chrono::steady_clock;
  catch_interrupts();
  make_output_folder(options.out);
  const auto model = build_model(scene);
  HeadlessContext context(options.gpu);
  const auto choice = choose_for(scene, model);
  if (choice) fmt::print("solver: {}\n", describe(*choice));
  Tuning tuning = tuning_from_environment();
  tuning.count_guards = true;
  Sim sim = create_sim(model, scene.settings, tuning);
  sim.timed = true;
  Metrics metrics = create_metrics(*model, sim.system);
  const long steps =
      options.steps > 0 ? options.steps : std::max(1L, std::lround(scene.duration / scene.settings.dt));
  const long video_every =
      options.video_every > 0 ? options.video_every : std::max(1L, std::lround(1.0 / 30 / scene.settings.dt));

  std::optional<FrameWriter> frames;
  if (options.png_every > 0 || !options.video.empty()) {
    frames.emplace(options, scene_camera(scene, *model, float(options.width) / float(options.height)),
                   make_renderer(*model), make_target(options.width, options.height, options.samples));
    if (!options.video.empty()) {
      const int rate = std::clamp(int(std::lround(1 / (double(video_every) * scene.settings.dt))), 1, 120);
      frames->video.emplace(options.video, options.width, options.height, rate);
    }
  }

  std::optional<GrowingFile> csv;
  if (options.csv_every > 0) csv.emplace(options.out / "stats.csv").add(csv_header());
  RunErrors errors;
  Timing timing;
  const auto take = [&](const std::optional<Measurement>& measurement) {
    if (!measurement) return false;
    add_measurement(errors, *measurement, sim);
    if (csv && measurement->step % options.csv_every == 0) csv->add(csv_row(*measurement, errors));
    return true;
  };
  {
    Progress progress("stepping", steps, options.progress);
    measure(metrics, sim);
    if (frames && !check_finite(sim))
      frames->draw_frame(sim, options.png_every > 0 ? 0 : -1, bool(frames->video));
    for (long s = 1; s <= steps && !interrupted() && !check_finite(sim); ++s) {
      const auto begin = Clock::now();
      step(sim);
      if (sim.solver.step_on_cpu == nullptr) glFinish();  // wall time of the work itself, not of queueing it
      const double seconds = std::chrono::duration<double>(Clock::now() - begin).count();
      const bool bad = check_finite(sim, true).has_value();  // the step is done, so this waits for nothing
      if (bad || s % options.measure_every == 0 || s == steps) measure(metrics, sim);
      if (bad) break;
      timing.wall_ms.add(seconds * 1e3);
      timing.total_s += seconds;
      while (const auto ms = sim.timer.poll()) timing.gpu_ms.add(*ms);
      while (take(collect(metrics))) {
      }
      if (frames) {
        const bool png = options.png_every > 0 && s % options.png_every == 0;
        const bool film = frames->video && s % video_every == 0;
        if (png || film) frames->draw_frame(sim, png ? s : -1, film);
      }
      progress.update(s);
    }
  }
  while (take(collect(metrics, true))) {
  }
  while (const auto ms = sim.timer.poll(true)) timing.gpu_ms.add(*ms);
  if (frames) frames->finish();
  errors.non_finite = check_finite(sim, true);
  errors.finite = errors.finite && !errors.non_finite;
  const bool good = !errors.non_finite || restore_checkpoint(sim);
  write_file(
      options.out / "stats.json",
      statistics_json(scene, sim, context.capabilities(), report(model->rest), timing, errors,
                      guard_counts(sim), good ? std::optional(state_hash(sim)) : std::nullopt, choice));
  if (csv) csv->close();
  if (options.positions && good) {
    std::vector<glm::vec3> positions;
    for (const glm::dvec3& p : in_original_order(*model, read_state(sim).positions))
      positions.emplace_back(p);
    write_npy(options.out / "positions.npy", positions);
    write_npy(options.out / "tets.npy", original_tets(*model));
  }
  fmt::print("{}: {} steps on {}, largest volume loss {:.2f} %, {:.3f} ms a step; {}\n", scene.name,
             sim.steps, context.capabilities().renderer, errors.max_volume_loss_percent,
             percentiles(timing.wall_ms.values).median, (options.out / "stats.json").string());
  if (interrupted())
    throw Error("interrupted", fmt::format("at step {} of {}", sim.steps, steps),
                "what was finished is written", 1);
  if (errors.non_finite) throw error_of(*errors.non_finite);
  if (!errors.finite)
    throw Error("a measurement is not finite",
                fmt::format("after step {}", errors.last ? errors.last->step : 0),
                "use a smaller --dt, more --substeps or a lower stiffness", 1);
  return 0;
}

int print_explanation(Scene scene, int gpu) {
  const auto model = build_model(scene);
  HeadlessContext context(gpu);
  if (const auto choice = choose_for(scene, model)) fmt::print("solver: {}\n", describe(*choice));
  const Sim sim = create_sim(model, scene.settings);
  const Explanation e = explain(sim);
  fmt::print("{}: mode {}, {} vertices, {} tets", scene.name, mode_word(sim.settings),
             model->positions.size(), model->rest.tets.size());
  for (std::size_t k = 0; k < sim.system.lists.size(); ++k)
    if (sim.system.present[k]) fmt::print(", {} {}", sim.system.lists[k].count(), constraint_kinds[k].name);
  fmt::print("\n\n{:<52}{:>14}\n", "buffer", "bytes");
  for (const auto& buffer : e.buffers) fmt::print("{:<52}{:>14}\n", buffer.name, buffer.bytes);
  fmt::print("{:<52}{:>14}  ({:.1f} a tet)\n\n", "all", e.bytes,
             double(e.bytes) / double(std::max<std::size_t>(1, model->rest.tets.size())));
  fmt::print("{:<52}{:>14}{:>14}{:>16}\n", "kernel", "work-groups", "a step", "bytes a step");
  for (const auto& dispatch : e.dispatches)
    fmt::print("{:<52}{:>14}{:>14}{:>16}\n", dispatch.name, dispatch.work_groups, dispatch.per_step,
               dispatch.bytes * std::size_t(dispatch.per_step));
  fmt::print("{:<52}{:>14}{:>14}{:>16}\n", "all", "", e.dispatches_per_step, e.bytes_per_step);
  if (e.dispatches.empty()) fmt::print("mode {} steps on the CPU and uploads positions\n", sim.settings.mode);
  return 0;
}

int print_info(int gpu) {
  fmt::print("tetpbd {} ({} build)\n", TETPBD_VERSION, TETPBD_BUILD);
  const auto devices = list_devices();
  for (std::size_t i = 0; i < devices.size(); ++i) fmt::print("--gpu {}: {}\n", i, devices[i]);
  HeadlessContext context(gpu);
  const Capabilities& c = context.capabilities();
  fmt::print("OpenGL vendor:   {}\nOpenGL renderer: {}{}\nOpenGL version:  {}\nGLSL version:    {}\n",
             c.vendor, c.renderer, c.software ? " (software: a CPU, not a GPU)" : "", c.version,
             c.shading_language);
  fmt::print("storage blocks:  {} a compute stage, {} bytes each at most\n", c.storage_blocks,
             c.storage_bytes);
  fmt::print("work-groups:     {} invocations, {} bytes of shared memory\nMSAA:            {} samples\n",
             c.work_group_invocations, c.shared_bytes, c.samples);
  fmt::print("extensions used: none beyond OpenGL 4.3 core\nmodels:          {}\n", models_folder().string());
  fmt::print("shaders:         {}\n", shader_folder().empty() ? "embedded" : shader_folder());
  fmt::print(
      "licences:        tetpbd MIT; TetGen, a program of its own, AGPL-3+; "
      "Stanford models: see models/README.md\n");
  return 0;
}

}  // namespace tetpbd
