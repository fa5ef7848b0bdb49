// The lanes' steps, in real time, and what is measured of them.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <utility>

#include "app/lab/run.h"
#include "app/lab/verdict.h"
#include "app/window/session.h"
#include "sim/error.h"
#include "sim/model/material.h"

namespace tetpbd {

namespace {

using Steady = std::chrono::steady_clock;

void begin_step(Session& s) {
  if (s.grab) {
    lead(*s.grab);
    perform(s, action::Lead{s.hold->caught(), s.grab->position});
  }
  note_moment(s);
  s.under_way.emplace();
}

void end_step(Session& s) {
  auto& lanes = s.loaded.lanes;
  s.step_seconds = s.under_way->seconds;
  s.under_way.reset();
  if (s.loaded.right && !s.loaded.disturbed && s.loaded.sim().steps > s.loaded.right->kept.back()) disturb(s);
  if ((lanes.size() > 1 && s.loaded.comparable) || right_now(s)) hold_lanes(lanes, right_now(s));
  if (right_now(s)) hold_vertices(s);  // of few steps the reference motion is kept
  s.clock.simulated += s.loaded.sim().settings.dt;
  keep_moment(s);
  note_step(s);
}

// Energy that nothing supplied is said once.
void follow_energy(Session& s, Lane& lane, const Measurement& now) {
  add_measurement(lane.ledger, now, *lane.sim.model, lane.sim.settings);
  if (lane.ledger.not_judged || now.by_hand) return;
  lane.created.add(100 * lane.ledger.relative(), now.time);
  if (lane.gain_said) return;
  const auto gain = judge_energy(lane.ledger, lane.sim);
  lane.gain_said = gain.has_value();
  if (gain) say(s, verdict_line({{*gain}}));
}

}  // namespace

bool step_lanes(Session& s, double seconds) {
  const auto begin = Steady::now();
  if (!s.under_way) begin_step(s);
  const auto enough = [&] { return seconds_since(begin) > seconds; };
  for (auto& [number, whole, of_lane] = *s.under_way; number < s.loaded.lanes.size(); ++number, of_lane = 0) {
    Lane& lane = s.loaded.lanes[number];
    const bool begins = lane.sim.substeps_done == 0;
    if (begins && s.loaded.lanes.size() > 1 && check_finite(lane.sim)) continue;
    const bool in_parts = std::isfinite(seconds);  // a timer of the driver would time what is drawn in between
    if (in_parts) lane.sim.timed = false;
    const auto part = Steady::now();
    const bool ended = step_until(lane.sim, enough);
    whole += seconds_since(part), of_lane += seconds_since(part);
    if (!ended) return false;
    if ((on_cpu(lane.sim) || in_parts) && s.measuring) lane.step_ms.add(of_lane * 1e3, simulated_time(lane.sim));
    if (number + 1 < s.loaded.lanes.size() && enough()) return ++number, of_lane = 0, false;
  }
  end_step(s);
  return true;
}

void step_lanes(Session& s) {
  while (!step_lanes(s, std::numeric_limits<double>::infinity())) {
  }
}

void finish_step(Session& s) {
  if (s.under_way) step_lanes(s);
}

void log_state(Session& s) {
  if (!s.log.file.is_open()) return;
  for (std::size_t i = 0; s.loaded.lanes.size() > 1 && i < s.loaded.lanes.size(); ++i) {
    const Sim& sim = s.loaded.lanes[i].sim;
    s.log("lane {} {} {} {:016x}", i + 1, sim.settings.mode, sim.steps, state_hash(sim));
  }
  s.log("state {} {:016x}", s.loaded.sim().steps, state_hash(s.loaded.sim()));
}

void play(Session& s, bool playing) {
  if (s.playing == playing) return;
  if (!playing) attempt(s, [&] { finish_step(s); });
  s.playing = playing;
  s.clock.owed = 0;
  s.log("{}", playing ? "play" : "pause");
  if (!playing) log_state(s);
}

void single_step(Session& s) {
  play(s, false);
  s.timeline.looping = false;
  attempt(s, [&] {
    step_lanes(s);
    measure_frame(s, true);
  });
  s.log("step {}", s.loaded.sim().steps);
  log_state(s);
}

void watch_state(Session& s) {
  if (s.loaded.lanes.size() > 1) return;  // that lane stops, and says so in its picture
  const auto& found = check_finite(s.loaded.sim());
  if (!found || (!s.playing && std::ranges::any_of(s.messages, &Message::non_finite))) return;
  let_go(s);
  play(s, false);
  forget_from(s, found->step);
  say(s, error_of(*found).what(), true, true);
}

std::optional<Advice> faster_way(const Session& s) {
  const Clock& clock = s.clock;
  const Settings& own = s.loaded.sim().settings;
  if (!s.playing || clock.fast || !(clock.factor > 0) || clock.factor > 0.5 * clock.speed()) return {};
  if (s.loaded.lanes.size() > 1) return Advice{"fewer lanes", ""};
  const auto& ms = s.loaded.lanes[s.loaded.chosen].step_ms.values;
  // Less than half of the time goes into steps.
  if (!ms.empty() && double(ms.back()) * clock.factor / own.dt < 500) {
    if (s.samples == 0 && !s.view.shadow) return Advice{"a smaller window", ""};
    return Advice{"turn off MSAA and shadows", "", [](Session& to) {
                    to.ui.kept.samples = to.samples = 0;
                    to.view.shadow = false, to.ui.kept.shadow = 0;
                    to.log("MSAA and shadows off");
                  }};
  }
  const bool with_forces = solver_mode(own).forces;
  const SolverMode& fast = *std::ranges::find_if(solver_modes(), &SolverMode::all_cores);
  if (!solver_mode(own).all_cores && !with_forces && (s.gl.software || on_cpu(s.loaded.sim())))
    return Advice{fmt::format("mode {}", fast.name), fmt::format("mode={}", fast.name)};
  if (const Plan& plan = s.loaded.sim().plan; all_materials(own, hard) && plan.iterations * plan.substeps > 5)
    return Advice{"solver hard", "hard,mode=" + own.mode};
  return Advice{"a smaller scene", ""};
}

void advance(Session& s, double elapsed) {
  Clock& clock = s.clock;
  clock.real += elapsed;
  ++clock.frames;
  if (clock.real >= 0.5) {
    clock.factor = clock.simulated / clock.real;
    if (s.playing)
      s.log("running {} {:.3f}x {:.0f} fps", s.loaded.sim().steps, clock.factor, clock.frames / clock.real);
    clock.frames = 0;
    clock.real = clock.simulated = 0;
  }
  if (!s.playing) return;
  const double dt = s.loaded.sim().settings.dt;
  clock.owed += std::min(elapsed, 0.25) * clock.speed();
  if (s.timeline.looping) return loop_on(s);
  // A driver that queues work hides what a step costs until the frame is late: then the number of steps a
  // frame is halved, and doubled while there is room. Where a step returns when it is done (CPU modes,
  // software GL) the time spent here says it all.
  const bool queued =
      !s.gl.software && std::ranges::none_of(s.loaded.lanes, [](const Lane& l) { return on_cpu(l.sim); });
  constexpr double patience = 0.04;  // s of stepping between two frames
  const auto begin = Steady::now();
  int taken = 0;
  // A step that takes longer than a frame may, or that is the first, is taken in parts: the window answers in between.
  const bool in_parts = s.under_way || (!queued && (s.step_seconds == 0 || s.step_seconds > patience));
  // As long as drawing takes, so that neither waits for the other for more than half of the time.
  const double part = std::clamp(elapsed - clock.stepping, 0.015, patience);
  while ((clock.fast || clock.owed >= dt || s.under_way) && (!queued || taken < clock.most_steps)) {
    if (!in_parts)
      step_lanes(s);
    else if (!step_lanes(s, part))
      break;
    clock.owed -= dt;
    ++taken;
    if (in_parts || seconds_since(begin) > patience) break;
  }
  clock.stepping = in_parts ? seconds_since(begin) : 0;
  if (queued && elapsed > 0.066) clock.most_steps = std::max(1, clock.most_steps / 2);
  if (queued && elapsed < 0.033 && taken == clock.most_steps)
    clock.most_steps = std::min(clock.most_steps * 2, 1 << 14);
  // What could not be simulated in time is dropped: the simulation then runs slower than real time.
  clock.owed = clock.fast ? 0 : std::min(clock.owed, dt);
}

void measure_frame(Session& s, bool stepped) {
  for (Lane& lane : s.loaded.lanes) {
    while (const auto ms = lane.sim.timer.poll()) lane.step_ms.add(*ms, simulated_time(lane.sim));
    lane.sim.timed = s.measuring;
    if (!s.measuring) continue;
    if (!lane.metrics) lane.metrics = create_metrics(lane.sim);
    while (const auto now = collect(*lane.metrics)) {
      follow_energy(s, lane, *now);
      lane.volume_error.add(now->finite() ? now->volume_error_percent : 0.0, now->time);
      lane.energy.add(now->finite() ? now->energy() + now->elastic : 0.0, now->time);
      const double depth = now->penetration_max;  // NaN without obstacles
      if (!std::isnan(depth)) lane.depth.add(100 * depth, now->time);
    }
    // Half the ring of results: with more under way, asking again would wait for the oldest.
    if (stepped && lane.metrics->pending.size() < 8) measure(*lane.metrics, lane.sim, s.hold.has_value());
  }
}

bool is_filling(const Session& s) { return s.loaded.map && !s.loaded.map->is_done(); }

void fill_map(Session& s) {
  if (!is_filling(s)) return;
  const std::size_t before = s.loaded.map->done;
  const double budget = s.playing ? 0.008 : 0.03;  // s of a frame
  if (!attempt(s, [&] { fill_map(*s.loaded.map, budget); })) return s.loaded.map.reset();
  if (s.loaded.map->done > before && s.loaded.map->is_done()) s.log("map done");
}

}  // namespace tetpbd
