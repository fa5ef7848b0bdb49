// The lanes' past: states that are kept while they step, within a budget, and shown again. To go on from a
// shown one forgets what came after it.
#pragma once

#include <memory>
#include <set>
#include <vector>

#include "app/window/lanes.h"
#include "sim/snapshot.h"

namespace tetpbd {

struct Session;

/// All lanes after a step, or at the start.
struct Moment {
  long step = 0;
  double time = 0;  ///< s, simulated
  std::vector<Snapshot> lanes;
  std::vector<History> distances;     ///< the last of each lane, if any
  bool disturbed = false;             ///< as in Loaded
  std::vector<std::uint32_t> pinned;  ///< by the user, or
  std::vector<std::uint32_t> held;    ///< as long as the mouse held them
  std::size_t bytes = 0;
  Buffer states{};
};

struct Timeline {
  std::size_t budget = std::size_t(256) << 20;   ///< bytes, on the GPU and of CPU modes; 0: nothing is kept
  std::vector<std::unique_ptr<Moment>> moments;  ///< in order of their steps
  std::size_t bytes = 0;                         ///< of all
  std::set<std::uint32_t> touched;               ///< vertices pinned at some time
  std::optional<std::set<long>> wanted{};        ///< only these steps are kept
  bool looping = false;                          ///< played again and again, in place of steps
  bool off = false;                              ///< until the next start: there is no room
};

/// From the state of now on.
void begin_timeline(Session& session);
/// After a step. Where the budget is used up, the moment goes that stands closest between its neighbours for
/// its age: all of late are kept, fewer of long ago, the start always.
void keep_moment(Session& session);
/// Of this step on, which was not good.
void forget_from(Session& session, long step);
/// The one kept of this step, or the nearest.
void show_step(Session& session, long step);
/// To the moment kept before, or after, which is a step where there is none; pauses.
void go_backward(Session& session);
void go_forward(Session& session);
/// Shows as many moments as the time asks for, then from the first one again.
void loop_on(Session& session);
void set_looping(Session& session, bool looping);

}  // namespace tetpbd
