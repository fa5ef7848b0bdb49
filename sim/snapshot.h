// Snapshots: the carried state copied and restored.
#pragma once

#include "sim/sim.h"

namespace tetpbd {

/// Bytes that a snapshot of the present state takes of a buffer, and of the computer's memory.
std::size_t snapshot_bytes(Sim& sim);
std::size_t snapshot_memory(const Sim& sim);
/// Queued. `to` has room from byte `at` on. With `good_only`, kernels write nothing once a state was not finite.
Snapshot take_snapshot(Sim& sim, const Buffer& to, std::size_t at, bool good_only = false);
/// Of the same model, in any mode, with the same vertices pinned. If the settings have changed since, restores the
/// state alone, with the present settings, and waits for the GPU. A preconditioner refresh that was under way is
/// finished at once, whereas the steps that followed then still had the old preconditioner for a while.
void restore_snapshot(Sim& sim, const Snapshot& snapshot, const Buffer& from);

/// From places and velocities alone, with the present settings; `dt` and `fall`, half_substep_fall(), are those of
/// the settings that led there.
void go_on_from(Sim& sim, State state, const StepValues& then, double dt, double fall);

}  // namespace tetpbd
