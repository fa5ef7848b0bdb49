// Whether the state is still finite. The last kernel of a step records the first vertex that is not
// (shaders/vertex_state.glsl), which the CPU reads back some steps later. The last good state is kept as a checkpoint.
#pragma once

#include <deque>
#include <optional>
#include <string>

#include "sim/carried.h"
#include "sim/error.h"
#include "sim/gl/pass.h"

namespace tetpbd {

/// For users; `where` names the run if there are several.
Error error_of(const NonFinite& found, const std::string& where = "");

/// Part of a Sim (sim.h), whose steps keep it up to date.
struct FiniteCheck {
  static constexpr long request_every = 32, checkpoint_every = 64;  ///< steps
  Buffer words, read_back;                                          ///< the kernels' block Check, and its readback
  Fence requested;
  Pass copy;  ///< checkpoint.comp
  Recorder recorder;
  Buffer checkpoint;          ///< ranges of the last snapshot before a state that is not finite
  std::deque<Snapshot> kept;  ///< the last ones; the step in `found` tells which of them `checkpoint` belongs to
  long known = 0;             ///< in GPU modes, the last step that is known to be finite, or not by `found`
  long requested_step = 0;    ///< the last step before the readback that is under way
  std::optional<NonFinite> found;
};

/// Copies ranges one after the other into `to` from byte `at` on, by a kernel; with `good_only`, unless a state was
/// not finite. Queued.
void copy_ranges(FiniteCheck& check, const std::vector<CarriedRange>& ranges, const Buffer& to, std::size_t at,
                 bool good_only);

}  // namespace tetpbd
