// Whether a simulation is still made of numbers. The last kernel of a step notes the first vertex that is not
// finite (shaders/vertex_state.glsl); the answer comes back late. The last good state is kept as a
// checkpoint.
#pragma once

#include <deque>
#include <optional>
#include <string>

#include "sim/carried.h"
#include "sim/error.h"
#include "sim/gl/pass.h"

namespace tetpbd {

/// What users are told; `where` names the run if there are several.
Error error_of(const NonFinite& found, const std::string& where = "");

/// Part of a Sim (sim.h), whose steps keep it up to date.
struct FiniteCheck {
  static constexpr long ask_every = 32, checkpoint_every = 64;  ///< steps
  Buffer words, read_back;  ///< the kernels' block, and its copy for an answer under way
  Fence requested;
  Pass copy;  ///< checkpoint.comp
  Recorder recorder;
  Buffer checkpoint;          ///< of the last snapshot before a state that is not finite
  std::deque<Snapshot> kept;  ///< the last ones: which of them `checkpoint` holds, the answer tells
  long first = 0;             ///< step of the state that was last given, the first checkpoint if it is finite
  long known = 0;             ///< GPU: steps up to this one are finite, or `found` says which is not
  long asked_step = 0;        ///< the step that the answer under way is of
  std::optional<NonFinite> found;
};

/// Bytes, multiples of four.
struct CopiedPart {
  const Buffer* from;
  std::size_t first;
  const Buffer* to;
  std::size_t at, bytes;
};
/// Of what kernels wrote, by a kernel; `good_only`: unless a state was not finite. Queued.
void copy_parts(FiniteCheck& check, const std::vector<CopiedPart>& parts, bool good_only);

}  // namespace tetpbd
