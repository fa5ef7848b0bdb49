// Copies of all that a step hands on, taken and gone back to.
#pragma once

#include "sim/sim.h"

namespace tetpbd {

/// That one of now takes of a buffer, and of memory.
std::size_t snapshot_bytes(Sim& sim);
std::size_t snapshot_memory(const Sim& sim);
/// Queued; `to` has room from `at` on. `good_only`: kernels leave `to` alone once a state was not finite.
Snapshot take_snapshot(Sim& sim, const Buffer& to, std::size_t at, bool good_only = false);
/// Of the same model, in any mode, with the same vertices pinned; with other settings than then, the state
/// alone, which goes on with those of now. Waits only in the second case. A preconditioner that was being
/// made anew is ready at once: until it was, the steps then had the old one.
void restore_snapshot(Sim& sim, const Snapshot& snapshot, const Buffer& from);

}  // namespace tetpbd
