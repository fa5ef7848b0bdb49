#include "app/lab/run_loop.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>

#include "sim/contact/faces.h"
#include "sim/contact/pairs.h"
#include "sim/gl/gpu.h"
#include "sim/interrupt.h"
#include "sim/measure/overlap.h"

namespace tetpbd {

using std::chrono::steady_clock;

double percentile(std::vector<double> values, double part) {
  if (values.empty()) return std::nan("");
  const auto chosen = values.begin() + std::lround(part * double(values.size() - 1));
  std::ranges::nth_element(values, chosen);
  return *chosen;
}

void print_error(const std::string& line) {
  std::fputs(line.c_str(), stderr);  // fmt::print() throws
  std::fflush(stderr);
}

void print_gl_error(const char* text) { print_error(fmt::format("GL error: {}\n", text)); }

Progress::Progress(const std::string& of, long steps, bool force, double lines_every, double quiet)
    : label(of), total(steps), bar(force || isatty(2)), every(bar ? 0.1 : lines_every) {
  if (quiet > 0)
    last = start + std::chrono::duration_cast<steady_clock::duration>(std::chrono::duration<double>(quiet - every));
  else if (!bar)
    last = start;
}

Progress::~Progress() {
  if (bar) print_error("\r\033[K");
}

void Progress::update(long done) {
  if (seconds_since(last) < every) return;
  last = steady_clock::now();
  const double left = seconds_since(start) * double(total - done) / double(done);
  print_error(fmt::format("{}{} {} of {}{}{}", bar ? "\r\033[K" : "", label, done, total,
                          done > 0 ? fmt::format(", {:.0f} s left", left) : "", bar ? "" : "\n"));
}

std::function<void(double)> fill_progress(const std::string& file) {
  const auto progress = std::make_shared<Progress>("filling " + file + ", per cent:", 100, false, 10, 2);
  return [progress](double part) { progress->update(std::lround(100 * part)); };
}

void hold_against(MeasuredRun& run, const Standard& standard, const Model& model, long step, double time,
                  const std::function<State()>& state) {
  const auto hold = [&](auto& error, auto& over_time, const Motion* motion, const auto* against) {
    if (!motion || !is_kept(*motion, step)) return;
    if (!error) error = MotionError{};
    add_state(*error, *against, model, step, state());
    over_time.push_back({time, error->final});
  };
  hold(run.motion, run.motion_over_time, standard.right, standard.right);
  hold(run.total, run.total_over_time, standard.total ? &standard.total->truth->motion : nullptr, standard.total);
}

namespace {

Crossings current_crossings(const Sim& sim) {
  return find_crossings(*sim.model, read_state(sim).positions, sim.settings.contact == "self");
}

// Of faces that obstacles could get in between, over their body's size.
double depth_of_faces(const Sim& sim, const std::vector<Triangle>& faces, const State& state) {
  const Model& model = *sim.model;
  const auto obstacles = obstacles_at(model, sim.settings, simulated_time(sim));
  double deepest = 0;
  for (const Body& body : model.bodies) {
    std::vector<Triangle> own;
    std::ranges::copy_if(faces, std::back_inserter(own), [&](const Triangle& face) {
      return face[0] >= body.first_vertex && face[0] < body.first_vertex + body.vertices;
    });
    const double size = body_bounds(body, model.rest.positions).size();
    deepest = std::max(deepest, deepest_face(own, obstacles, state.positions) / size);
  }
  return deepest;
}

// Whether more pairs of triangles cut each other than at the start, which goes into the errors.
bool crossed(const Sim& sim, std::size_t at_start, RunErrors& errors) {
  const Crossings now = current_crossings(sim);
  if (now.pairs <= at_start) return false;
  if (!errors.overlap) errors.overlap.emplace();
  errors.overlap->crossings = largest(errors.overlap->crossings, now);
  return true;
}

}  // namespace

MeasuredRun run_loop(Sim& sim, Metrics* metrics, long steps, const RunPlan& plan) {
  MeasuredRun run;
  sim.timed = plan.timed;
  const auto take = [&](bool wait) {
    while (const auto measurement = metrics ? collect(*metrics, wait) : std::nullopt) {
      add_measurement(run.errors, *measurement, sim);
      if (plan.measured)
        plan.measured(*measurement, run.errors);
      else
        run.measurements.push_back(*measurement);
    }
    while (const auto ms = sim.timer.poll(wait)) run.gpu_ms.push_back(*ms);
  };
  const auto hold = [&](long s) {
    hold_against(run, plan.standard, *sim.model, s, double(s) * sim.settings.dt, [&] { return read_state(sim); });
  };
  const bool touching = metrics && bodies_touch(*sim.model, sim.settings);
  const std::vector<Triangle> faces = metrics ? wide_faces(*sim.model) : std::vector<Triangle>();
  if (metrics) measure(*metrics, sim);
  hold(0);
  const std::size_t at_start = plan.check_crossings ? current_crossings(sim).pairs : 0;
  const auto begin = steady_clock::now();
  while (run.steps < steps && !interrupted() && !check_finite(sim)) {
    const auto step_begin = steady_clock::now();
    step(sim);
    if (plan.wait) glFinish();
    const double seconds = seconds_since(step_begin);
    const bool bad = check_finite(sim, plan.wait).has_value();  // a step waited for is done: no second wait
    const long s = run.steps + 1;
    if (metrics && (bad || s % plan.measure_every == 0 || s == steps)) measure(*metrics, sim);
    if (bad) break;
    run.steps = s;
    if (plan.wait) run.wall_ms.push_back(seconds * 1e3), run.seconds += seconds;
    take(false);
    hold(s);
    const bool seen = s % steps_per_frame(sim.settings.dt) == 0 || s == steps;  // in a film
    if (seen && (touching || !faces.empty())) {
      const State state = read_state(sim);
      if (!faces.empty())
        run.errors.penetration_max = std::fmax(run.errors.penetration_max, depth_of_faces(sim, faces, state));
      if (touching)
        run.errors.overlap = largest(run.errors.overlap.value_or(Overlap{}),
                                     measure_overlap(*sim.model, state.positions, sim.settings.contact == "self"));
    }
    if (plan.check_crossings && crossed(sim, at_start, run.errors)) run.errors.crossed = s;
    if (plan.stepped) plan.stepped(s);
    if (run.errors.crossed || !run.errors.finite || seconds_since(begin) >= plan.most_seconds) break;
  }
  if (!plan.wait) {
    glFinish();
    run.seconds = seconds_since(begin);
  }
  take(true);
  run.errors.non_finite = check_finite(sim, true);
  run.substeps = std::max(sim.plan.substeps, sim.adaptive.most_substeps);
  run.errors.finite = run.errors.finite && !run.errors.non_finite;
  return run;
}

MeasuredRun run_model(const std::shared_ptr<const Model>& model, const Settings& settings, long steps,
                      const Standard& standard, bool timed, const std::function<void(const Sim&, long)>& stepped) {
  Sim sim = create_sim(model, settings);
  if (timed) warm_up(sim);
  Metrics metrics = create_metrics(sim);
  RunPlan plan{.standard = standard};
  if (stepped) plan.stepped = [&](long s) { stepped(sim, s); }, stepped(sim, 0);
  return run_loop(sim, &metrics, steps, plan);
}

void warm_up(Sim& sim) {
  if (is_software_renderer() || on_cpu(sim)) return;
  run_loop(sim, nullptr, std::numeric_limits<long>::max(), {.most_seconds = 0.5});
  reset(sim);
}

}  // namespace tetpbd
