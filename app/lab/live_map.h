// The map of `tetpbd map` in slices, beside what the window does: its runs advance a little in every frame, and the
// reference motions of soft bodies are found in a thread.
#pragma once

#include <atomic>
#include <future>
#include <memory>

#include "app/lab/map.h"

namespace tetpbd {

struct MapCell {
  enum State { waiting, running, finished, failed, refused } state = waiting;
  Settings settings;
  double percent = 0;  ///< map_percent(), at some sixteen instants of the run
  long failed_at = 0;  ///< step
  std::string why{};   ///< refused
  std::optional<std::uint64_t> hash{};
};

struct LiveMap {
  static constexpr std::size_t most_tets = 20000;
  Variation x, y;
  std::shared_ptr<const Model> model;
  double seconds = 0;                ///< of motion
  std::vector<MapCell> cells{};      ///< rows of x
  std::vector<std::size_t> order{};  ///< in which they are filled: those of one motion one after the other
  std::size_t done = 0;
  bool motion = false;  ///< the last cell had a right one

  /// Of the run under way, which points at them.
  std::unique_ptr<Sim> sim{};
  std::unique_ptr<Metrics> metrics{};
  std::shared_ptr<const Motion> right{};
  std::optional<Run> run{};
  std::uint64_t right_of = 0;  ///< scene_key

  /// Of the thread; it ends early when told to.
  struct Search {
    std::shared_ptr<std::atomic<bool>> stop = std::make_shared<std::atomic<bool>>(false);
    std::future<std::optional<Motion>> answer{};
    ~Search() { *stop = true; }
  };
  std::unique_ptr<Search> search{};
  bool is_done() const { return done >= order.size(); }
};

/// Throws Error for axes that are none, and for bodies that are too large.
LiveMap start_map(std::shared_ptr<const Model> model, const Settings& base, const std::string& x, const std::string& y,
                  double seconds);
/// Goes on for about so long (s), but for what a change of settings compiles.
void fill_map(LiveMap& map, double budget);

}  // namespace tetpbd
