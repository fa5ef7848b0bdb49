#include "app/window/timeline.h"

#include <algorithm>
#include <cmath>

#include "app/window/session.h"

namespace tetpbd {

namespace {

constexpr std::size_t most_moments = 1000;  // more than a slider tells apart

long step_at(const Timeline& t, std::size_t index) { return t.moments[index]->step; }

// Its buffer may serve again.
Buffer drop(Timeline& t, std::size_t index) {
  Buffer states = std::move(t.moments[index]->states);
  t.bytes -= t.moments[index]->bytes;
  t.moments.erase(t.moments.begin() + std::ptrdiff_t(index));
  return states;
}

// But the first, which is the start.
std::size_t least_missed(const Timeline& t, long now) {
  std::size_t found = 0;
  double least = INFINITY;
  for (std::size_t i = 1; i < t.moments.size(); ++i) {
    const long next = i + 1 < t.moments.size() ? step_at(t, i + 1) : now;
    const double missed = double(next - step_at(t, i - 1)) / double(now - step_at(t, i));
    if (missed < least) least = missed, found = i;
  }
  return found;
}

// The first of this step or a later one.
std::size_t place_of(const Timeline& t, long step) {
  const auto found = std::ranges::lower_bound(t.moments, step, {}, [](const auto& m) { return m->step; });
  return std::size_t(found - t.moments.begin());
}

void show(Session& s, std::size_t index) {
  Timeline& t = s.timeline;
  const Moment& then = *t.moments[index];
  for (std::size_t i = 0; i < s.loaded.lanes.size(); ++i) {
    Lane& lane = s.loaded.lanes[i];
    for (const std::uint32_t vertex : t.touched)
      if (const bool pinned = is_pinned(lane.sim, vertex); pinned != bool(std::ranges::count(then.pinned, vertex)))
        pinned ? unpin(lane.sim, vertex) : pin(lane.sim, vertex);
    restore_snapshot(lane.sim, then.lanes[i], then.states);
    unpin(lane.sim, then.held);
    lane.apart = {}, lane.ledger = {};
    if (s.loaded.disturbed != then.disturbed) lane.distance = then.distances[i];  // held against something else
  }
  s.loaded.disturbed = then.disturbed;
  s.loaded.held = -1;
  if (s.record) s.record->shown = true;
}

void go(Session& s, std::size_t index) {
  if (index >= s.timeline.moments.size()) return;
  let_go(s);
  play(s, false);
  s.timeline.looping = false;
  if (!attempt(s, [&] { show(s, index); })) return;
  s.clock.owed = 0;
  std::erase_if(s.messages, &Message::non_finite);
  s.log("moment {}", step_at(s.timeline, index));
  log_state(s);
}

}  // namespace

void begin_timeline(Session& s) {
  Timeline& t = s.timeline;
  t.moments.clear(), t.touched.clear();
  t.bytes = 0;
  t.looping = t.off = false;
  keep_moment(s);
}

void forget_from(Session& s, long step) {
  Timeline& t = s.timeline;
  while (!t.moments.empty() && t.moments.back()->step >= step) drop(t, t.moments.size() - 1);
}

void keep_moment(Session& s) {
  Timeline& t = s.timeline;
  auto& lanes = s.loaded.lanes;
  const long now = steps_of(lanes);
  forget_from(s, now);
  if (t.budget == 0 || t.off || (t.wanted && !t.wanted->contains(now))) return;
  std::size_t on_gpu = 0, bytes = 0;
  for (Lane& lane : lanes) on_gpu += snapshot_bytes(lane.sim), bytes += snapshot_memory(lane.sim);
  bytes += on_gpu;
  if (bytes > t.budget / 4)
    say(s, fmt::format("no history: a state of {:.0f} MB is too large for it (--history-mb)", double(bytes) / 1e6));
  t.off =
      bytes > t.budget / 4 || !attempt(s, [&] {
        Buffer states;
        while (!t.moments.empty() && (t.bytes + bytes > t.budget || (t.moments.size() >= most_moments && !t.wanted))) {
          Buffer freed = drop(t, least_missed(t, now));
          if (freed.bytes() == on_gpu) states = std::move(freed);
        }
        if (on_gpu && !states) states = Buffer("moment", on_gpu);
        auto moment = std::make_unique<Moment>(now, simulated_time(lanes.front().sim));
        std::size_t at = 0;
        for (Lane& lane : lanes) {
          moment->lanes.push_back(take_snapshot(lane.sim, states, at));
          at += snapshot_bytes(lane.sim);
          History& last = moment->distances.emplace_back();
          if (const auto far = lane.far()) last.add(double(*far), simulated_time(lane.sim));
        }
        moment->disturbed = s.loaded.disturbed;
        for (const std::uint32_t vertex : t.touched)
          if (is_pinned(lanes.front().sim, vertex)) moment->pinned.push_back(vertex);
        if (s.hold && !s.hold->was_pinned) moment->held = s.hold->vertices;
        moment->bytes = bytes;
        moment->states = std::move(states);
        t.moments.push_back(std::move(moment));
        t.bytes += bytes;
      });
  if (t.off) t.moments.clear(), t.bytes = 0;
}

void show_step(Session& s, long step) {
  const Timeline& t = s.timeline;
  if (t.moments.empty()) return;
  std::size_t index = std::min(place_of(t, step), t.moments.size() - 1);
  if (index > 0 && step - step_at(t, index - 1) < step_at(t, index) - step) --index;
  go(s, index);
}

void go_backward(Session& s) {
  between_steps(s, [&s] { go(s, place_of(s.timeline, steps_of(s.loaded.lanes)) - 1); });
}

void go_forward(Session& s) {
  between_steps(s, [&s] {
    const std::size_t next = place_of(s.timeline, steps_of(s.loaded.lanes) + 1);
    next < s.timeline.moments.size() ? go(s, next) : single_step(s);
  });
}

void loop_on(Session& s) {
  const Timeline& t = s.timeline;
  if (t.moments.size() < 2) return;
  const double dt = s.loaded.sim().settings.dt;
  const std::size_t before = std::min(place_of(t, steps_of(s.loaded.lanes)), t.moments.size() - 1);
  std::size_t index = before;
  for (;;) {
    const std::size_t next = (index + 1) % t.moments.size();
    const double seconds = next ? t.moments[next]->time - t.moments[index]->time : dt;
    if (s.clock.owed < seconds - 1e-9) break;
    s.clock.owed -= seconds;
    s.clock.simulated += seconds;
    index = next;
    if (index == 0) s.log("loop");
  }
  if (index != before) attempt(s, [&] { show(s, index); });
}

void set_looping(Session& s, bool looping) {
  if (s.timeline.looping == looping) return;
  let_go(s);
  s.timeline.looping = looping;
  s.clock.owed = 0;
  s.log("looping {}", looping);
  play(s, looping);  // ended, it stands where it is: to play on forgets what comes after
}

}  // namespace tetpbd
