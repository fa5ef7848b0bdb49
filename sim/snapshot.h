// All that a step hands on to the next, copied: whoever goes back to it goes on with the same bits. Of GPU
// modes it lies in a buffer, of CPU modes in memory.
#pragma once

#include "sim/sim.h"

namespace tetpbd {

struct Snapshot {
  long steps = 0;
  TimeOrigin origin;
  Settings settings;
  double quantum = 0;  // these as in Sim
  bool needs_predict = true;
  unsigned read_index = 0, rigid_side = 0;
  WatchNumbers watch{};
  PairNumbers pairs{};
  bool asked = false, pairs_asked = false;
  std::optional<NonFinite> found{};
  std::optional<State> host{};  ///< of a CPU mode
  std::size_t at = 0;           ///< first byte in the buffer
};

/// That one of now takes of a buffer, and of memory.
std::size_t snapshot_bytes(const Sim& sim);
std::size_t snapshot_memory(const Sim& sim);
/// Queued; `to` has room from `at` on.
Snapshot take_snapshot(const Sim& sim, const Buffer& to, std::size_t at);
/// Of the same model, in any mode, with the same vertices pinned; with other settings than then, the state
/// alone, which goes on with those of now. Waits only where the mode wants it as another type, or, with other
/// settings, where bodies touch.
void restore_snapshot(Sim& sim, const Snapshot& snapshot, const Buffer& from);

}  // namespace tetpbd
