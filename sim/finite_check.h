// Whether a simulation is still made of numbers. The last kernel of a step notes the first vertex that is not
// finite (shaders/vertex.glsl); the answer comes back late. The last good state is kept as a checkpoint.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "sim/error.h"
#include "sim/gl/gpu.h"
#include "sim/model.h"

namespace tetpbd {

/// The first state that is not finite: its step, and the lowest of its vertices that are not.
struct NonFinite {
  long step = 0;
  std::uint32_t vertex = 0;
};
/// What users are told; `where` names the run if there are several.
Error error_of(const NonFinite& found, const std::string& where = "");

/// Part of a Sim (sim.h), whose steps keep it up to date.
struct FiniteCheck {
  static constexpr long ask_every = 32, checkpoint_every = 64;  ///< steps
  Buffer words, read_back;  ///< the kernels' block, and its copy for an answer under way
  Fence asked;
  Program copy;                  ///< checkpoint.comp
  Buffer positions, velocities;  ///< the checkpoint of a GPU mode,
  State host;                    ///< and of a CPU mode
  long first = 0;       ///< step of the state that was last given, the first checkpoint if it is finite
  long known = 0;       ///< GPU: steps up to this one are finite, or `found` says which is not
  long asked_step = 0;  ///< the step that the answer under way is of
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
void copy_parts(const FiniteCheck& check, const std::vector<CopiedPart>& parts, bool good_only);

}  // namespace tetpbd
