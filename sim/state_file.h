// A state as a file, from which a run goes on.
#pragma once

#include <filesystem>

#include "sim/sim.h"

namespace tetpbd {

/// Writes all that the next step depends on. Waits for the GPU. Throws Error where the state is not finite or the file
/// cannot be written.
void save_state(Sim& sim, const std::filesystem::path& file);
/// Goes on from a state of the same model, with the vertices pinned that were. With the same settings the next steps
/// give the bits that they would have given there, and the result is true; with others, or where buffers had grown,
/// places and velocities alone are taken over. Throws Error, and leaves all as it was, for what save_state() did not
/// write, for damaged files and for other models.
bool load_state(Sim& sim, const std::filesystem::path& file);

}  // namespace tetpbd
