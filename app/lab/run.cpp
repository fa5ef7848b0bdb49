#include "app/lab/run.h"

#include <algorithm>
#include <cmath>

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

double step_ms(const MeasuredRun& run) {
  const double gpu = median(run.gpu_ms);
  return gpu > 0 ? gpu : median(run.wall_ms);
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

// Stepper::inspect: at the frames of a film, how deep faces are in obstacles and bodies in each other; after each step,
// where that is asked for, whether surfaces cut each other.
std::function<void(RunErrors&, long, bool)> inspect_contact(const Sim& sim, bool measured, bool check_crossings) {
  const bool touching = measured && bodies_touch(*sim.model, sim.settings);
  const std::vector<Triangle> faces = measured ? wide_faces(*sim.model) : std::vector<Triangle>();
  const std::size_t at_start = check_crossings ? current_crossings(sim).pairs : 0;
  return [=, &sim](RunErrors& errors, long s, bool last) {
    const bool seen = s % steps_per_frame(sim.settings.dt) == 0 || last;
    if (seen && (touching || !faces.empty())) {
      const State state = read_state(sim);
      if (!faces.empty()) errors.penetration_max = std::fmax(errors.penetration_max, depth_of_faces(sim, faces, state));
      if (touching)
        errors.overlap = largest(errors.overlap.value_or(Overlap{}),
                                 measure_overlap(*sim.model, state.positions, sim.settings.contact == "self"));
    }
    if (check_crossings && crossed(sim, at_start, errors)) errors.crossed = s;
  };
}

Stepper simulation_stepper(Sim& sim, Metrics* metrics, const RunPlan& plan) {
  Stepper stepper{sim.model.get(), sim.settings.dt};
  stepper.step = [&sim] { step(sim); };
  stepper.state = [&sim] { return read_state(sim); };
  if (metrics) stepper.measure = [&sim, metrics] { measure(*metrics, sim); };
  stepper.collect = [&sim, metrics](Run& run, bool wait) {
    while (const auto measurement = metrics ? collect(*metrics, wait) : std::nullopt) {
      add_measurement(run.so_far.errors, *measurement, sim);
      if (run.plan.measured)
        run.plan.measured(*measurement, run.so_far.errors);
      else
        run.so_far.measurements.push_back(*measurement);
    }
    while (const auto ms = sim.timer.poll(wait)) run.so_far.gpu_ms.push_back(*ms);
  };
  stepper.find_non_finite = [&sim](bool wait) { return check_finite(sim, wait); };
  stepper.hash = [&sim] { return state_hash(sim); };
  stepper.substeps = [&sim] { return std::max(sim.plan.substeps, sim.adaptive.most_substeps); };
  if (plan.pace != Pace::batches) stepper.inspect = inspect_contact(sim, metrics != nullptr, plan.check_crossings);
  return stepper;
}

bool is_due(const Run& run, long s, long every) { return s % every == 0 || s == run.steps; }

void measure_state(Run& run, long s) {
  if (run.stepper.measure && is_due(run, s, run.plan.measure_every)) run.stepper.measure();
}

// The distance from the standard, where that has the step.
void compare_state(Run& run, long s) {
  if (!is_due(run, s, run.plan.compare_every)) return;
  const auto compare = [&](auto& error, auto& over_time, const Motion* motion, const auto* against) {
    if (!motion || !is_kept(*motion, s)) return;
    if (!error) error = MotionError{};
    add_state(*error, *against, *run.stepper.model, s, run.stepper.state());
    over_time.push_back({double(s) * run.stepper.dt, error->final});
  };
  const auto& [right, total] = run.plan.standard;
  compare(run.so_far.motion, run.so_far.motion_over_time, right, right);
  compare(run.so_far.total, run.so_far.total_over_time, total ? &total->truth->motion : nullptr, total);
}

// What is to be known of step s, which is finite.
void observe_step(Run& run, long s) {
  run.so_far.steps = s;
  run.stepper.collect(run, false);
  compare_state(run, s);
  if (run.stepper.inspect) run.stepper.inspect(run.so_far.errors, s, s == run.steps);
  if (run.plan.stepped) run.plan.stepped(s);
  run.done = s == run.steps || run.so_far.errors.crossed || !run.so_far.errors.finite ||
             seconds_since(run.began) >= run.plan.most_seconds || interrupted();
}

void take_step(Run& run) {
  const bool wait = run.plan.pace == Pace::each_step;
  const auto begin = steady_clock::now();
  run.stepper.step();
  if (wait) glFinish();
  const double seconds = seconds_since(begin);
  const long s = run.so_far.steps + 1;
  run.done = run.stepper.find_non_finite(wait).has_value();  // a step waited for is done: no second wait
  if (run.done && run.stepper.measure) run.stepper.measure();
  if (run.done) return;
  measure_state(run, s);
  if (wait) run.so_far.wall_ms.push_back(seconds * 1e3), run.so_far.seconds += seconds;
  observe_step(run, s);
}

// Up to the next state that is to be looked at.
void queue_batch(Run& run, const std::function<bool()>& in_time) {
  long& s = run.queued_steps;
  for (long i = 0; i < run.batch && (i == 0 || in_time()); ++i) {
    run.stepper.step();
    measure_state(run, ++s);
    if (is_due(run, s, run.plan.measure_every) || is_due(run, s, run.plan.compare_every)) break;
  }
  run.queued = Fence::here();
}

// False while the GPU has not come to the end of the batch. More at once while it keeps up, fewer where it does not.
bool take_batch(Run& run, bool wait) {
  if (!reached(run.queued.sync(), wait, "a run")) {
    run.batch = std::max(1L, run.batch / 2);
    return false;
  }
  run.batch = std::min(run.batch * 2, 256L);
  run.queued = {};
  run.done = run.stepper.find_non_finite(true).has_value();
  if (!run.done) observe_step(run, run.queued_steps);
  return true;
}

}  // namespace

Run begin(Stepper stepper, long steps, const RunPlan& plan) {
  Run run{std::move(stepper), steps, plan};
  if (run.stepper.measure) run.stepper.measure();
  if (plan.pace == Pace::batches)
    run.queued = Fence::here();  // reading the start back now would wait for all that is queued
  else
    compare_state(run, 0);
  run.done = steps <= 0 || interrupted() || run.stepper.find_non_finite(false);
  run.began = steady_clock::now();
  return run;
}

Run begin(Sim& sim, Metrics* metrics, long steps, const RunPlan& plan) {
  sim.timed = plan.timed;
  return begin(simulation_stepper(sim, metrics, plan), steps, plan);
}

bool advance(Run& run, double budget) {
  const auto in_time = [budget, from = steady_clock::now()] { return seconds_since(from) < budget; };
  while (!run.done && in_time()) {
    if (run.plan.pace != Pace::batches)
      take_step(run);
    else if (!run.queued)
      queue_batch(run, in_time);
    else if (!take_batch(run, budget == std::numeric_limits<double>::infinity()))
      break;
  }
  return run.done;
}

MeasuredRun finish(Run& run) {
  if (run.plan.pace == Pace::queued) {
    glFinish();
    run.so_far.seconds = seconds_since(run.began);
  }
  run.stepper.collect(run, true);
  RunErrors& errors = run.so_far.errors;
  errors.non_finite = run.stepper.find_non_finite(true);
  errors.finite = errors.finite && !errors.non_finite;
  run.so_far.substeps = run.stepper.substeps();
  if (errors.finite) run.so_far.hash = run.stepper.hash();
  return std::move(run.so_far);
}

MeasuredRun run_to_end(Sim& sim, Metrics* metrics, long steps, const RunPlan& plan) {
  Run run = begin(sim, metrics, steps, plan);
  advance(run);
  return finish(run);
}

MeasuredRun run_model(const std::shared_ptr<const Model>& model, const Settings& settings, long steps,
                      const Standard& standard, bool timed, const std::function<void(const Sim&, long)>& stepped) {
  Sim sim = create_sim(model, settings);
  if (timed) warm_up(sim);
  Metrics metrics = create_metrics(sim);
  RunPlan plan{.standard = standard};
  if (stepped) plan.stepped = [&](long s) { stepped(sim, s); }, stepped(sim, 0);
  return run_to_end(sim, &metrics, steps, plan);
}

void warm_up(Sim& sim) {
  if (is_software_renderer() || on_cpu(sim)) return;
  run_to_end(sim, nullptr, std::numeric_limits<long>::max(), {.most_seconds = 0.5});
  reset(sim);
}

}  // namespace tetpbd
