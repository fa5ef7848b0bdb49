#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <fstream>

#include "app/commands.h"
#include "app/files.h"
#include "app/lab/auto_solver.h"
#include "sim/error.h"
#include "sim/gl/context.h"
#include "sim/interrupt.h"

namespace tetpbd {

namespace {

// What a run of any length may do. Memory may grow by what an allocator or a driver keeps back once, not by
// steps.
constexpr double most_drift = 1e-4;        // of the body's size
constexpr double most_growth = 8 << 20;    // bytes, from a tenth of the run to its end
constexpr double least_speed_ratio = 0.8;  // steps a second, last tenth over first; clocks of GPUs vary
constexpr long most_samples = 1000;

double resident_bytes() {
  std::ifstream file("/proc/self/statm");
  double all = 0, resident = 0;
  file >> all >> resident;
  return resident * double(sysconf(_SC_PAGESIZE));
}

double steps_per_second(const ordered_json& from, const ordered_json& to) {
  return (number(to, "step") - number(from, "step")) / (number(to, "seconds") - number(from, "seconds"));
}

}  // namespace

int run_soak(Scene scene, const SoakOptions& options) {
  make_output_folder(options.out);
  const auto model = build_model(scene);
  HeadlessContext context(options.gpu);
  choose_and_say(scene, model);
  Sim sim = create_sim(model, scene.settings);
  Metrics metrics = create_metrics(sim);

  // Steps are queued, never waited for one by one; the GPU is at most a ring of measurements behind.
  RunPlan plan{.measure_every = std::max(1L, options.steps / most_samples), .pace = Pace::queued, .timed = false};
  run_to_end(sim, &metrics, options.settle, plan);
  const GlLive live = gl_live();  // no measurement under way, as at the end: their fences count
  ordered_json samples;           // a row of soak.csv each, counted from the end of settling
  Progress progress("stepping", options.steps, options.progress);
  plan.stepped = [&](long s) { progress.update(s); };
  const auto begin = std::chrono::steady_clock::now();
  plan.measured = [&](const Measurement& m, const RunErrors& errors) {
    if (!m.finite()) return;
    const Measurement& start = *errors.first;
    samples.push_back({{"step", m.step - start.step},
                       {"seconds", seconds_since(begin)},
                       {"centre_x", m.centre.x},
                       {"centre_y", m.centre.y},
                       {"centre_z", m.centre.z},
                       {"drift", glm::length(m.centre - start.centre) / model->size},
                       {"kinetic_energy", m.kinetic},
                       {"resident_bytes", resident_bytes()},
                       {"gl_buffer_bytes", gl_live().buffer_bytes}});
  };
  const MeasuredRun run = run_to_end(sim, &metrics, options.steps, plan);
  if (run.errors.non_finite) throw error_of(*run.errors.non_finite);
  if (interrupted()) throw Interrupted();

  const GlLive live_after = gl_live();
  const auto at = [&](double part) -> const ordered_json& {
    return samples[std::size_t(std::ceil(part * double(samples.size() - 1)))];
  };
  const double first_speed = steps_per_second(at(0), at(0.1)), last_speed = steps_per_second(at(0.9), at(1));
  const double growth = number(at(1), "resident_bytes") - number(at(0.1), "resident_bytes");
  double drift = 0;
  for (const auto& sample : samples) drift = std::max(drift, number(sample, "drift"));
  ordered_json checks;
  std::string failed;
  const auto check = [&](const char* name, double value, double limit, bool passed) {
    checks.push_back({{"name", name}, {"value", value}, {"limit", limit}, {"passed", passed}});
    if (!passed) failed += fmt::format("{}{} {:.3g} (limit {:.3g})", failed.empty() ? "" : ", ", name, value, limit);
  };
  check("drift", drift, most_drift, drift <= most_drift);
  check("resident_growth_bytes", growth, most_growth, growth <= most_growth);
  const double new_bytes = double(live_after.buffer_bytes - live.buffer_bytes);
  check("gl_buffer_growth_bytes", new_bytes, 0, new_bytes == 0);
  const double new_objects = double(live_after.objects - live.objects);
  check("gl_object_growth", new_objects, 0, new_objects == 0);
  const double ratio = last_speed / first_speed;
  check("speed_ratio", ratio, least_speed_ratio, ratio >= least_speed_ratio);

  const ordered_json document = {{"scene", scene.name},
                                 {"mode", sim.settings.mode},
                                 {"device", device_json(context.capabilities())},
                                 {"settle", options.settle},
                                 {"steps", at(1)["step"]},
                                 {"size", model->size},
                                 {"gl_buffer_bytes", {{"start", live.buffer_bytes}, {"end", live_after.buffer_bytes}}},
                                 {"gl_objects", {{"start", live.objects}, {"end", live_after.objects}}},
                                 {"steps_per_second", {{"first_tenth", first_speed}, {"last_tenth", last_speed}}},
                                 {"finite", run.errors.finite},
                                 {"state_hash", hash_json(run.hash)},
                                 {"checks", checks},
                                 {"passed", failed.empty()}};
  write_file(options.out / "soak.csv", csv_text(keys(samples[0]), samples));
  write_file(options.out / "soak.json", json_text(document, 2) + "\n");
  fmt::print(
      "{}: {} steps at rest on {}: drift {:.2g} of the size, resident {:+.1f} MiB, {:.0f} then {:.0f} steps "
      "a second; {}\n",
      scene.name, run.steps, context.capabilities().renderer, drift, growth / (1 << 20), first_speed, last_speed,
      (options.out / "soak.json").string());
  if (!failed.empty())
    throw Error("the soak test failed", failed, "see soak.csv; a body that still moves needs a longer --settle", 1);
  return 0;
}

}  // namespace tetpbd
