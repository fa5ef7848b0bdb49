#include "app/lab/live_map.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "app/lab/run_loop.h"
#include "sim/error.h"
#include "sim/interrupt.h"
#include "sim/model/material.h"

namespace tetpbd {

namespace {

MapCell& now_filled(LiveMap& map) { return map.cells[map.order[map.done]]; }

void end_cell(LiveMap& map, MapCell::State state) {
  now_filled(map).state = state;
  ++map.done;
  map.queued = {};
  if (map.is_done()) map.sim.reset(), map.right.reset();  // what it held of the GPU
}

// Whether what the cell is held against is there.
bool has_answer(LiveMap& map) {
  const MapCell& cell = now_filled(map);
  const std::uint64_t key = scene_key(*map.model, cell.settings);
  if (map.right_of == key && !map.search) return true;
  if (!map.search) {
    map.right_of = key;
    map.search = std::make_unique<LiveMap::Search>();
    const auto find = [model = map.model, settings = cell.settings, steps = map.steps, stop = map.search->stop] {
      return answer_for(*model, settings, steps, [&](long) {
        if (*stop) throw Interrupted();
      });
    };
    map.search->answer = std::async(std::launch::async, find);
  }
  if (map.search->answer.wait_for(std::chrono::seconds(0)) != std::future_status::ready) return false;
  const auto search = std::exchange(map.search, nullptr);
  try {
    map.right = search->answer.get();
  } catch (const Error&) {
    map.right.reset();  // as a body that its own forces tear
  }
  return true;
}

void begin_cell(LiveMap& map) {
  MapCell& cell = now_filled(map);
  cell.state = MapCell::running;
  map.error = {}, map.loss = 0, map.batch = 1;
  map.motion = map.right.has_value();
  if (!map.sim) {
    map.sim = create_sim(map.model, cell.settings);
  } else {
    apply_settings(*map.sim, cell.settings);
    reset(*map.sim);
  }
}

// Some sixteen times in a run; of the reference motion only where it is kept.
bool is_instant(const LiveMap& map, long step) {
  if (step == map.steps) return true;
  return step % std::max(1l, map.steps / 16) == 0 && (!map.right || is_kept(*map.right, step));
}

// The GPU has come to this step, so that nothing here waits.
void judge(LiveMap& map) {
  Sim& sim = *map.sim;
  MapCell& cell = now_filled(map);
  if (const auto& found = check_finite(sim, true)) {
    cell.failed_at = found->step;
    return end_cell(map, MapCell::failed);
  }
  if (!is_instant(map, sim.steps)) return;
  const State state = read_state(sim);
  if (map.right) {
    add_state(map.error, *map.right, *map.model, sim.steps, state);
  } else {
    const double now = mesh_volume({state.positions, map.model->rest.tets, {}});
    if (map.volume > 0) map.loss = std::max(map.loss, 100 * (map.volume - now) / map.volume);
  }
  cell.percent = map.right ? 100 * map.error.rms : map.loss;
  if (sim.steps >= map.steps) end_cell(map, std::isfinite(cell.percent) ? MapCell::finished : MapCell::failed);
}

// A batch of steps, or what comes before and after one; false while it has to wait.
bool go_on(LiveMap& map, const std::function<bool()>& in_time) {
  if (now_filled(map).state == MapCell::waiting) {
    map.steps = std::clamp(std::lround(map.seconds / now_filled(map).settings.dt), 1l, 100000l);
    if (!has_answer(map)) return false;
    begin_cell(map);
  } else if (!reached(map.queued.sync(), false, "filling a map")) {
    map.batch = std::max(1l, map.batch / 2);
    return false;
  } else {
    map.batch = std::min(map.batch * 2, 256l);
    judge(map);
    if (map.is_done() || now_filled(map).state != MapCell::running) return true;
  }
  for (long i = 0; i < map.batch && (i == 0 || in_time()); ++i) {
    step(*map.sim);
    if (is_instant(map, map.sim->steps)) break;
  }
  map.queued = Fence::here();
  return true;
}

}  // namespace

LiveMap start_map(std::shared_ptr<const Model> model, const Settings& base, const std::string& x, const std::string& y,
                  double seconds) {
  LiveMap map{.x = map_axis(x, "across"), .y = map_axis(y, "up"), .model = std::move(model), .seconds = seconds};
  if (map.model->rest.tets.size() > LiveMap::most_tets)
    throw Error(fmt::format("a map here is of at most {} tets", LiveMap::most_tets), "stability map",
                "take a smaller scene, or tetpbd map");
  const std::size_t columns = map.x.values.size();
  for (const std::string& up : map.y.values)
    for (const std::string& across : map.x.values) {
      MapCell& cell = map.cells.emplace_back();
      cell.settings = base;
      set_parameter(cell.settings, *map.x.row, across, "across");
      set_parameter(cell.settings, *map.y.row, up, "up");
      check_settings(cell.settings, fmt::format("{} {}, {} {}", map.x.row->name, across, map.y.row->name, up));
    }
  map.volume = mesh_volume(map.model->rest);
  map.order.resize(map.cells.size());
  std::iota(map.order.begin(), map.order.end(), std::size_t(0));
  // By columns, where it is `x` that changes the motion, or makes the solver again.
  const auto costs = [&](const MapAxis& axis, std::size_t other) {
    return axis.values.size() > 1 &&
           scene_key(*map.model, map.cells[0].settings) != scene_key(*map.model, map.cells[other].settings);
  };
  if (costs(map.x, std::min<std::size_t>(1, columns - 1)) && !costs(map.y, std::min(columns, map.cells.size() - 1)))
    std::ranges::sort(map.order, {}, [&](std::size_t i) { return std::pair(i % columns, i / columns); });
  return map;
}

void fill_map(LiveMap& map, double budget) {
  const auto in_time = [budget, begin = std::chrono::steady_clock::now()] { return seconds_since(begin) < budget; };
  try {
    while (!map.is_done() && in_time() && go_on(map, in_time)) {
    }
  } catch (const ContextLost&) {
    throw;
  } catch (const Error& error) {  // of this setting: its mode does not go so far
    now_filled(map).why = error.what();
    map.sim.reset();
    end_cell(map, MapCell::refused);
  }
}

}  // namespace tetpbd
