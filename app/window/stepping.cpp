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

constexpr double patience = 0.04;  // s of stepping between two frames

void begin_step(Session& s) {
  if (s.grab) {
    lead(*s.grab);
    perform(s, action::Lead{s.hold->caught(), s.grab->position});
  }
  note_moment(s);
}

// Those that step; of several, one that is not finite stands still.
std::vector<Lane*> stepping_lanes(Session& s) {
  std::vector<Lane*> lanes;
  for (Lane& lane : s.loaded.lanes)
    if (s.loaded.lanes.size() == 1 || !check_finite(lane.sim)) lanes.push_back(&lane);
  return lanes;
}

void end_step(Session& s) {
  auto& lanes = s.loaded.lanes;
  if (s.loaded.right && !s.loaded.disturbed && s.loaded.lane().steps() > s.loaded.right->kept.back()) disturb(s);
  if ((lanes.size() > 1 && s.loaded.comparable) || right_now(s)) hold_lanes(lanes, right_now(s));
  if (right_now(s)) hold_vertices(s);  // of few steps the reference motion is kept
  s.clock.simulated += s.loaded.sim().settings.dt;
  keep_moment(s);
  note_step(s);
}

// In the thread. A timer of the driver would time what is drawn meanwhile.
void launch(Session& s) {
  begin_step(s);
  s.under_way = std::make_unique<Session::UnderWay>();
  auto& [lanes, seconds, whole] = *s.under_way;
  lanes = stepping_lanes(s);
  for (Lane* lane : lanes) lane->sim.timed = false;
  for (Lane& lane : s.loaded.lanes) keep_shown(lane, s.view);
  s.thread->start([step = s.under_way.get(), thread = s.thread] {
    for (Lane* lane : step->lanes) {
      const auto begin = Steady::now();
      if (!step_unless(lane->sim, [&] { return thread->is_given_up(); })) return;
      glFinish();
      step->seconds.push_back(seconds_since(begin));
    }
    step->whole = true;
  });
}

// Waits for so many seconds, and says whether no step is under way any more.
bool land(Session& s, double seconds) {
  if (!s.under_way) return true;
  std::exception_ptr thrown;
  try {
    if (!s.thread->wait(seconds)) return false;
  } catch (...) {
    thrown = std::current_exception();
  }
  const auto step = std::move(s.under_way);
  for (Lane& lane : s.loaded.lanes) lane.shown.reset();
  if (step->whole) {
    s.step_seconds = 0;
    for (std::size_t i = 0; i < step->lanes.size(); ++i) {
      Lane& lane = *step->lanes[i];
      s.step_seconds += step->seconds[i];
      if (s.measuring) lane.step_ms.add(1e3 * step->seconds[i], lane.time());
      break_attachments(lane.sim);
    }
    end_step(s);
  }
  while (!s.waiting.empty() && !s.under_way) {
    const auto act = std::move(s.waiting.front().act);
    s.waiting.pop_front();
    attempt(s, act);
  }
  if (thrown) std::rethrow_exception(thrown);
  return !s.under_way;
}

// Whether a driver queues work: what a step costs is then seen when the frame is late.
bool is_queued(const Session& s) {
  return !s.gl.software && std::ranges::none_of(s.loaded.lanes, [](const Lane& l) { return on_cpu(l.sim); });
}

// A step that takes longer than a frame may, or where it may be, the first.
bool is_slow(const Session& s) {
  return s.thread && (s.step_seconds > patience || (s.step_seconds == 0 && !is_queued(s)));
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

void step_lanes(Session& s) {
  const auto begin = Steady::now();
  begin_step(s);
  for (Lane* lane : stepping_lanes(s)) {
    const auto own = Steady::now();
    step(lane->sim);
    if (on_cpu(lane->sim) && s.measuring) lane->step_ms.add(1e3 * seconds_since(own), lane->time());
  }
  if (!is_queued(s)) s.step_seconds = seconds_since(begin);
  end_step(s);
}

void begin_slow_step(Session& s) {
  if (s.playing && !s.under_way && !s.task && !s.timeline.looping && is_slow(s) &&
      (s.clock.fast || s.clock.owed >= s.loaded.sim().settings.dt))
    launch(s);
}

void finish_step(Session& s) {
  while (!land(s, std::numeric_limits<double>::infinity())) {
  }
}

void give_up_step(Session& s) {
  if (s.under_way) s.thread->give_up();
}

void between_steps(Session& s, std::function<void()> act) {
  s.under_way ? void(s.waiting.push_back({std::move(act)})) : void(attempt(s, act));
}

namespace {

// The last of a kind that waits, if it is of this lane.
template <class Kind>
const Kind* waiting_action(const Session& s, const auto& counts) {
  const Kind* found = nullptr;
  for (const Waiting& w : s.waiting)
    if (const Kind* own = w.action ? std::get_if<Kind>(&*w.action) : nullptr; own && counts(*own)) found = own;
  return found;
}

}  // namespace

const Settings& asked_settings(const Session& s, std::size_t lane) {
  const auto* set = waiting_action<action::Set>(s, [&](const auto& a) { return a.lane == lane; });
  return set ? set->settings : s.loaded.lanes[lane].sim.settings;
}

const Settings& asked_settings(const Session& s) { return asked_settings(s, s.loaded.chosen); }

const std::vector<Obstacle>& asked_obstacles(const Session& s) {
  const auto* set = waiting_action<action::SetObstacles>(s, [](const auto&) { return true; });
  return set ? set->obstacles : s.loaded.scene.obstacles;
}

void log_state(Session& s) {
  if (!s.log.file.is_open()) return;
  for (std::size_t i = 0; s.loaded.lanes.size() > 1 && i < s.loaded.lanes.size(); ++i) {
    const Sim& sim = s.loaded.lanes[i].sim;
    s.log("lane {} {} {} {:016x}", i + 1, sim.settings.mode, sim.steps, state_hash(sim));
  }
  s.log("state {} {:016x}", s.loaded.lane().steps(), state_hash(s.loaded.sim()));
}

void play(Session& s, bool playing) {
  if (s.playing == playing) return;
  s.playing = playing;
  s.clock.owed = 0;
  s.log("{}", playing ? "play" : "pause");
  if (!playing) between_steps(s, [&s] { log_state(s); });
}

void single_step(Session& s) {
  play(s, false);
  s.timeline.looping = false;
  between_steps(s, [&s] {
    attempt(s, [&] {
      if (is_slow(s)) return launch(s);
      step_lanes(s);
      measure_frame(s, true);
    });
    between_steps(s, [&s] {
      s.log("step {}", s.loaded.lane().steps());
      log_state(s);
    });
  });
}

void watch_state(Session& s) {
  // Of several, that lane stops, and says so in its picture.
  if (s.loaded.lanes.size() > 1 || s.under_way) return;
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
  if (const Plan& plan = s.loaded.lane().plan(); all_materials(own, hard) && plan.iterations * plan.substeps > 5)
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
      s.log("running {} {:.3f}x {:.0f} fps", s.loaded.lane().steps(), clock.factor, clock.frames / clock.real);
    clock.frames = 0;
    clock.real = clock.simulated = 0;
  }
  // Where drawing needs the cores that step, as long as it took; with a GPU not at all.
  const double part = is_queued(s) ? 0 : std::clamp(elapsed - clock.waited, 0.015, patience);
  const auto begin = Steady::now();
  const double simulated = clock.simulated, dt = s.loaded.sim().settings.dt;
  if (s.playing) clock.owed += std::min(elapsed, 0.25) * clock.speed();
  const bool landed = land(s, part);
  clock.waited = seconds_since(begin);
  if (clock.simulated != simulated) clock.owed -= dt;
  if (!s.playing) return;
  if (s.timeline.looping) return landed ? loop_on(s) : void();
  // A driver that queues work hides what a step costs until the frame is late: then the number of steps a
  // frame is halved, and doubled while there is room. Where a step returns when it is done (CPU modes,
  // software GL) the time spent here says it all.
  const bool queued = is_queued(s);
  int taken = 0;
  while (!is_slow(s) && !s.under_way && (clock.fast || clock.owed >= dt) && (!queued || taken < clock.most_steps)) {
    step_lanes(s);
    clock.owed -= dt;
    ++taken;
    if (seconds_since(begin) > patience) break;
  }
  if (queued && elapsed > 0.066 && taken > 0) {
    if (clock.most_steps == 1) s.step_seconds = elapsed;  // one by itself is too slow
    clock.most_steps = std::max(1, clock.most_steps / 2);
  }
  if (queued && elapsed < 0.033 && taken == clock.most_steps)
    clock.most_steps = std::min(clock.most_steps * 2, 1 << 14);
  // What could not be simulated in time is dropped: the simulation then runs slower than real time.
  clock.owed = clock.fast ? 0 : std::min(clock.owed, dt);
}

void measure_frame(Session& s, bool stepped) {
  if (s.under_way) return;
  for (Lane& lane : s.loaded.lanes) {
    while (const auto ms = lane.sim.timer.poll()) lane.step_ms.add(*ms, lane.time());
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
