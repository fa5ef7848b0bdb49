#include "app/lab/live_map.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "sim/error.h"
#include "sim/interrupt.h"

namespace tetpbd {

namespace {

MapCell& current_cell(LiveMap& map) { return map.cells[map.order[map.done]]; }

long steps_of_cell(const LiveMap& map, const MapCell& cell) {
  return std::clamp(std::lround(map.seconds / cell.settings.dt), 1l, 100000l);
}

void end_cell(LiveMap& map, MapCell::State state) {
  current_cell(map).state = state;
  ++map.done;
  map.run.reset();
  if (map.is_done()) map.sim.reset(), map.metrics.reset(), map.right.reset();  // what it held of the GPU
}

// Whether what the cell is compared with is there.
bool has_answer(LiveMap& map) {
  const MapCell& cell = current_cell(map);
  const std::uint64_t key = scene_key(*map.model, cell.settings);
  if (map.right_of == key && !map.search) return true;
  if (!map.search) {
    map.right_of = key;
    map.search = std::make_unique<LiveMap::Search>();
    const auto find = [model = map.model, settings = cell.settings, steps = steps_of_cell(map, cell),
                       stop = map.search->stop] {
      return answer_for(*model, settings, steps, [&](long) {
        if (*stop) throw Interrupted();
      });
    };
    map.search->answer = std::async(std::launch::async, find);
  }
  if (map.search->answer.wait_for(std::chrono::seconds(0)) != std::future_status::ready) return false;
  const auto search = std::exchange(map.search, nullptr);
  map.right.reset();
  try {
    if (auto found = search->answer.get()) map.right = std::make_shared<const Motion>(std::move(*found));
  } catch (const Error&) {  // as of a body that its own forces tear
  }
  return true;
}

void begin_cell(LiveMap& map) {
  MapCell& cell = current_cell(map);
  cell.state = MapCell::running;
  map.motion = map.right != nullptr;
  if (!map.sim) {
    map.sim = std::make_unique<Sim>(create_sim(map.model, cell.settings));
  } else {
    apply_settings(*map.sim, cell.settings);
    reset(*map.sim);
  }
  map.metrics = map.right ? nullptr : std::make_unique<Metrics>(create_metrics(*map.sim));
  const long steps = steps_of_cell(map, cell), every = std::max(1l, steps / 16);
  map.run = begin(*map.sim, map.metrics.get(), steps,
                  {.measure_every = every,
                   .compare_every = every,
                   .pace = Pace::batches,
                   .timed = false,
                   .standard = map.right.get()});
}

void judge_cell(LiveMap& map) {
  const MeasuredRun run = finish(*map.run);
  MapCell& cell = current_cell(map);
  if (run.errors.non_finite) cell.failed_at = run.errors.non_finite->step;
  cell.percent = map_percent(map_row(run), map.motion);
  cell.hash = run.hash;
  end_cell(map, std::isfinite(cell.percent) ? MapCell::finished : MapCell::failed);
}

}  // namespace

LiveMap start_map(std::shared_ptr<const Model> model, const Settings& base, const std::string& x, const std::string& y,
                  double seconds) {
  LiveMap map{
      .x = parse_variation(x, "across"), .y = parse_variation(y, "up"), .model = std::move(model), .seconds = seconds};
  if (map.model->rest.tets.size() > LiveMap::most_tets)
    throw Error(fmt::format("a map here is of at most {} tets", LiveMap::most_tets), "stability map",
                "take a smaller scene, or tetpbd map");
  const std::size_t columns = map.x.values.size();
  for (const Settings& settings : map_cells(base, map.x, map.y)) map.cells.emplace_back().settings = settings;
  map.order.resize(map.cells.size());
  std::iota(map.order.begin(), map.order.end(), std::size_t(0));
  // By columns, where it is `x` that changes the motion, or makes the solver again.
  const auto costs = [&](const Variation& axis, std::size_t other) {
    return axis.values.size() > 1 &&
           scene_key(*map.model, map.cells[0].settings) != scene_key(*map.model, map.cells[other].settings);
  };
  if (costs(map.x, std::min<std::size_t>(1, columns - 1)) && !costs(map.y, std::min(columns, map.cells.size() - 1)))
    std::ranges::sort(map.order, {}, [&](std::size_t i) { return std::pair(i % columns, i / columns); });
  return map;
}

void fill_map(LiveMap& map, double budget) {
  const auto left = [budget, begin = std::chrono::steady_clock::now()] { return budget - seconds_since(begin); };
  try {
    while (!map.is_done() && left() > 0) {
      if (!map.run && !has_answer(map)) return;
      if (!map.run) begin_cell(map);
      if (!advance(*map.run, left())) return;
      judge_cell(map);
    }
  } catch (const ContextLost&) {
    throw;
  } catch (const Error& error) {  // of this setting: its mode does not go so far
    current_cell(map).why = error.what();
    map.sim.reset();
    end_cell(map, MapCell::refused);
  }
}

}  // namespace tetpbd
