#include "app/soak.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include "app/auto_solver.h"
#include "app/files.h"
#include "app/progress.h"
#include "app/statistics.h"
#include "sim/error.h"
#include "sim/gl/context.h"
#include "sim/metrics.h"

namespace tetpbd {

using nlohmann::ordered_json;

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

/// The run at one of its steps, counted from the end of settling.
struct Sample {
  long step = 0;
  double seconds = 0;
  Measurement measurement;
  double resident = 0;
  GlLive gl;
};

struct Watch {
  std::vector<Sample> samples;  ///< the first at step 0
  double size = 1;              ///< m
  double largest_shift = 0;     ///< m, of a vertex from start to end

  double drift(const Sample& sample) const {
    return glm::length(sample.measurement.centre - samples.front().measurement.centre) / size;
  }
  const Sample& at(double part) const {
    const long step = std::lround(part * double(samples.back().step));
    return *std::find_if(samples.begin(), samples.end(), [&](const Sample& s) { return s.step >= step; });
  }
  double speed(const Sample& from, const Sample& to) const {
    return to.seconds > from.seconds ? double(to.step - from.step) / (to.seconds - from.seconds) : 0;
  }
};

// Steps are queued, never waited for one by one; the GPU is at most two samples behind.
Watch watch_rest(Sim& sim, Metrics& metrics, const SoakOptions& options) {
  using Clock = std::chrono::steady_clock;
  Progress progress("stepping", options.settle + options.steps, options.progress);
  const long every = std::max(1L, options.steps / most_samples);
  for (long s = 1; s <= options.settle; ++s) {
    step(sim);
    if (s % every == 0) measure_now(metrics, sim), progress.update(s);
  }
  Watch watch;
  watch.size = sim.model->size;
  const State before = read_state(sim);
  const Measurement start = measure_now(metrics, sim);
  const auto begin = Clock::now();
  watch.samples.push_back({0, 0, start, resident_bytes(), gl_live()});
  const auto take = [&] {
    const auto measurement = collect(metrics, true);
    const double seconds = std::chrono::duration<double>(Clock::now() - begin).count();
    watch.samples.push_back(
        {measurement->step - start.step, seconds, *measurement, resident_bytes(), gl_live()});
    return measurement->finite();
  };
  bool finite = start.finite();
  for (long s = 1; s <= options.steps && finite; ++s) {
    step(sim);
    if (s % every != 0 && s != options.steps) continue;
    measure(metrics, sim);
    if (metrics.pending.size() > 1) finite = take();
    progress.update(options.settle + s);
  }
  while (!metrics.pending.empty()) take();
  const State after = read_state(sim);
  for (std::size_t i = 0; i < before.positions.size(); ++i)
    watch.largest_shift =
        std::max(watch.largest_shift, glm::length(after.positions[i] - before.positions[i]));
  return watch;
}

std::string csv_of(const Watch& watch) {
  std::string csv =
      "step,seconds,centre_x,centre_y,centre_z,drift,kinetic_energy,resident_bytes,gl_buffer_bytes\n";
  for (const Sample& s : watch.samples) {
    const Measurement& m = s.measurement;
    csv +=
        fmt::format("{},{:.6g},{:.9g},{:.9g},{:.9g},{:.6g},{:.6g},{:.0f},{}\n", s.step, s.seconds, m.centre.x,
                    m.centre.y, m.centre.z, watch.drift(s), m.kinetic, s.resident, s.gl.buffer_bytes);
  }
  return csv;
}

}  // namespace

int run_soak(Scene scene, const SoakOptions& options) {
  make_output_folder(options.out);
  const auto model = build_model(scene);
  HeadlessContext context(options.gpu);
  if (const auto choice = choose_for(scene, model)) fmt::print("solver: {}\n", describe(*choice));
  Sim sim = create_sim(model, scene.settings);
  Metrics metrics = create_metrics(*model, sim.system);
  const Watch watch = watch_rest(sim, metrics, options);

  const Sample &first = watch.samples.front(), &last = watch.samples.back(), &tenth = watch.at(0.1);
  double drift = 0;
  bool finite = true;
  for (const Sample& s : watch.samples) {
    drift = std::max(drift, watch.drift(s));
    finite = finite && s.measurement.finite();
  }
  const double first_speed = watch.speed(first, tenth), last_speed = watch.speed(watch.at(0.9), last);
  ordered_json checks = ordered_json::array();
  std::string failed;
  const auto check = [&](const char* name, double value, double limit, bool good) {
    checks.push_back({{"name", name}, {"value", json_number(value)}, {"limit", limit}, {"passed", good}});
    if (!good)
      failed += (failed.empty() ? "" : ", ") + fmt::format("{} {:.3g} (limit {:.3g})", name, value, limit);
  };
  check("drift", drift, most_drift, finite && drift <= most_drift);
  const double growth = last.resident - tenth.resident;
  check("resident_growth_bytes", growth, most_growth, growth <= most_growth);
  const double buffers = double(last.gl.buffer_bytes - first.gl.buffer_bytes);
  check("gl_buffer_growth_bytes", buffers, 0, buffers == 0);
  const double objects = double(last.gl.objects - first.gl.objects);
  check("gl_object_growth", objects, 0, objects == 0);
  check("speed_ratio", last_speed / first_speed, least_speed_ratio,
        last_speed >= least_speed_ratio * first_speed);

  ordered_json j;
  j["scene"] = scene.name;
  j["mode"] = sim.settings.mode;
  j["device"] = device_json(context.capabilities());
  j["settle"] = options.settle;
  j["steps"] = last.step;
  j["size"] = watch.size;
  j["centre"] = {{"drift", json_number(drift)}, {"final_drift", json_number(watch.drift(last))}};
  j["largest_vertex_shift"] = json_number(watch.largest_shift / watch.size);
  j["kinetic_energy"] = {{"start", json_number(first.measurement.kinetic)},
                         {"end", json_number(last.measurement.kinetic)}};
  j["resident_bytes"] = {{"start", first.resident}, {"tenth", tenth.resident}, {"end", last.resident}};
  j["gl_buffer_bytes"] = {{"start", first.gl.buffer_bytes}, {"end", last.gl.buffer_bytes}};
  j["gl_objects"] = {{"start", first.gl.objects}, {"end", last.gl.objects}};
  j["steps_per_second"] = {{"first_tenth", json_number(first_speed)},
                           {"last_tenth", json_number(last_speed)}};
  j["finite"] = finite;
  j["state_hash"] = fmt::format("{:016x}", state_hash(sim));
  j["checks"] = checks;
  j["passed"] = failed.empty();
  write_file(options.out / "soak.csv", csv_of(watch));
  write_file(options.out / "soak.json", json_text(j, 2) + "\n");
  fmt::print(
      "{}: {} steps at rest on {}: drift {:.2g} of the size, resident {:+.1f} MiB, {:.0f} then {:.0f} steps "
      "a "
      "second; {}\n",
      scene.name, last.step, context.capabilities().renderer, drift, growth / (1 << 20), first_speed,
      last_speed, (options.out / "soak.json").string());
  if (!finite)
    throw Error("the state is not finite", fmt::format("at step {} after settling", last.step),
                "use a smaller --dt, more --substeps or a lower stiffness", 1);
  if (!failed.empty())
    throw Error("the soak test failed", failed,
                "see soak.csv; a body that still moves needs a longer --settle", 1);
  return 0;
}

}  // namespace tetpbd
