#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <fstream>

#include "app/auto_solver.h"
#include "app/files.h"
#include "app/lab.h"
#include "app/statistics.h"
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

/// The run at one of its steps, counted from the end of settling: a row of soak.csv.
ordered_json sample_of(const Measurement& m, const Measurement& start, double size, double seconds) {
  return {{"step", m.step - start.step},
          {"seconds", seconds},
          {"centre_x", m.centre.x},
          {"centre_y", m.centre.y},
          {"centre_z", m.centre.z},
          {"drift", glm::length(m.centre - start.centre) / size},
          {"kinetic_energy", m.kinetic},
          {"resident_bytes", resident_bytes()},
          {"gl_buffer_bytes", gl_live().buffer_bytes}};
}

double steps_per_second(const ordered_json& from, const ordered_json& to) {
  return (number(to, "step") - number(from, "step")) / (number(to, "seconds") - number(from, "seconds"));
}

}  // namespace

int run_soak(Scene scene, const SoakOptions& options) {
  catch_interrupts();
  make_output_folder(options.out);
  const auto model = build_model(scene);
  HeadlessContext context(options.gpu);
  if (const auto choice = choose_for(scene, model)) fmt::print("solver: {}\n", describe(*choice));
  Sim sim = create_sim(model, scene.settings);
  Metrics metrics = create_metrics(*model, sim.system);
  const double size = model->size;

  // Steps are queued, never waited for one by one; the GPU is at most a ring of measurements behind.
  Progress progress("stepping", options.steps, options.progress);
  RunPlan plan{.measure_every = std::max(1L, options.steps / most_samples), .wait = false, .timed = false};
  run_loop(sim, &metrics, options.settle, plan);
  const State before = read_state(sim);
  const GlLive live = gl_live();  // no measurement under way, as at the end: their fences count
  std::vector<ordered_json> samples;
  plan.progress = &progress;
  const auto begin = std::chrono::steady_clock::now();
  plan.measured = [&](const Measurement& m, const RunErrors& errors) {
    if (m.finite()) samples.push_back(sample_of(m, *errors.first, size, seconds_since(begin)));
  };
  const MeasuredRun run = run_loop(sim, &metrics, options.steps, plan);
  if (run.errors.non_finite) throw error_of(*run.errors.non_finite);
  if (interrupted()) throw Interrupted();
  const GlLive live_after = gl_live();

  const auto at = [&](double part) -> const ordered_json& {
    return samples[std::size_t(std::ceil(part * double(samples.size() - 1)))];
  };
  const ordered_json &first = at(0), &tenth = at(0.1), &last = at(1);
  double drift = 0, shift = 0;
  for (const auto& sample : samples) drift = std::max(drift, number(sample, "drift"));
  const State after = read_state(sim);
  for (std::size_t i = 0; i < before.positions.size(); ++i)
    shift = std::max(shift, glm::length(after.positions[i] - before.positions[i]));
  const double first_speed = steps_per_second(first, tenth), last_speed = steps_per_second(at(0.9), last);
  const double growth = number(last, "resident_bytes") - number(tenth, "resident_bytes");
  ordered_json checks = ordered_json::array();
  std::vector<std::string> failed;
  const auto check = [&](const char* name, double value, double limit, bool good) {
    checks.push_back({{"name", name}, {"value", value}, {"limit", limit}, {"passed", good}});
    if (!good) failed.push_back(fmt::format("{} {:.3g} (limit {:.3g})", name, value, limit));
  };
  const auto at_most = [&](const char* name, double value, double limit) {
    check(name, value, limit, value <= limit);
  };
  at_most("drift", drift, most_drift);
  at_most("resident_growth_bytes", growth, most_growth);
  at_most("gl_buffer_growth_bytes", std::abs(double(live_after.buffer_bytes - live.buffer_bytes)), 0);
  at_most("gl_object_growth", std::abs(double(live_after.objects - live.objects)), 0);
  const double ratio = last_speed / first_speed;
  check("speed_ratio", ratio, least_speed_ratio, ratio >= least_speed_ratio);

  const ordered_json document = {
      {"scene", scene.name},
      {"mode", sim.settings.mode},
      {"device", device_json(context.capabilities())},
      {"settle", options.settle},
      {"steps", last["step"]},
      {"size", size},
      {"largest_vertex_shift", shift / size},
      {"gl_buffer_bytes", {{"start", live.buffer_bytes}, {"end", live_after.buffer_bytes}}},
      {"gl_objects", {{"start", live.objects}, {"end", live_after.objects}}},
      {"steps_per_second", {{"first_tenth", first_speed}, {"last_tenth", last_speed}}},
      {"finite", run.errors.finite},
      {"state_hash", fmt::format("{:016x}", state_hash(sim))},
      {"checks", checks},
      {"passed", failed.empty()}};
  std::vector<std::string> columns;
  for (const auto& [column, value] : first.items()) columns.push_back(column);
  write_file(options.out / "soak.csv", csv_text(columns, samples));
  write_file(options.out / "soak.json", json_text(document, 2) + "\n");
  fmt::print(
      "{}: {} steps at rest on {}: drift {:.2g} of the size, resident {:+.1f} MiB, {:.0f} then {:.0f} steps "
      "a second; {}\n",
      scene.name, run.steps, context.capabilities().renderer, drift, growth / (1 << 20), first_speed,
      last_speed, (options.out / "soak.json").string());
  if (!failed.empty())
    throw Error("the soak test failed", fmt::format("{}", fmt::join(failed, ", ")),
                "see soak.csv; a body that still moves needs a longer --settle", 1);
  return 0;
}

}  // namespace tetpbd
