// Whether a simulation is still made of numbers. The last kernel of a step notes the first vertex that is not
// finite (shaders/first_bad.glsl); the answer comes back through a fence, and the last good state is kept on
// the GPU.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "sim/error.h"
#include "sim/gl/gpu.h"
#include "sim/solvers/solver.h"

namespace tetpbd {

struct Sim;

struct NonFinite {
  long step = 0;             ///< the first whose state is not finite
  std::uint32_t vertex = 0;  ///< the lowest of them
  std::string cause, mend;   ///< the likeliest, in words, and what to do about it
};

/// Part of a Sim; step() and write_state() keep it up to date.
struct FiniteCheck {
  Buffer words, read_back;  ///< first_bad.glsl's block, and its copy
  Program keep;
  Buffer positions, velocities;  ///< the kept state; of a CPU mode it is in `host`
  State host;
  GLsync fence = nullptr;
  long base = 0;       ///< step of the state that was last given
  long checked = 0;    ///< what is known: steps up to this one are finite
  long asked = 0;      ///< steps that the copy under way tells of
  long reloaded = -1;  ///< step at which shaders were last compiled again
  bool kept = false;   ///< there is a good state to go back to
  std::optional<NonFinite> found;

  FiniteCheck() = default;
  FiniteCheck(FiniteCheck&& other) noexcept { *this = std::move(other); }
  FiniteCheck& operator=(FiniteCheck&& other) noexcept;
  ~FiniteCheck();
};

/// The first state that was not finite, once it is known; with `wait`, of all steps so far. Throws
/// ContextLost.
const std::optional<NonFinite>& check_finite(Sim& sim, bool wait = false);
/// Back to the kept state, at most 64 steps before the one found, and to its step; false where there is none.
bool return_to_kept(Sim& sim);
/// To the state just before the one found: from the kept one by the same steps again, the same bits. For runs
/// whose settings, shaders and pins did not change; false as above. `found` stays.
bool return_to_last_good(Sim& sim);
/// What users are told; `where` names the run if there are several.
Error error_of(const NonFinite& found, const std::string& where = "");

// For sim.cpp
void make_check_words(FiniteCheck& check);
void make_kept(Sim& sim);                        ///< room for the kept state
void start_check(Sim& sim, const State& given);  ///< a state was given
void check_step(Sim& sim);                       ///< a step was queued, or taken on the CPU
unsigned check_slot(long step);                  ///< first_bad.glsl's step_slot

}  // namespace tetpbd
