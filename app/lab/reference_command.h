// `tetpbd reference`: finds a scene's reference motion (sim/reference/motion.h) and keeps it in a file; and those
// files.
#pragma once

#include <filesystem>
#include <optional>

#include "app/scene.h"
#include "sim/reference/total_error.h"

namespace tetpbd {

struct ReferenceOptions {
  long steps = 0;               ///< 0: the scene's duration
  std::string method{};         ///< leapfrog, implicit, ten-node (total_error.h); empty: what suits the scene
  std::filesystem::path out{};  ///< empty: in the cache, where runs of the scene find it
  bool progress = false;        ///< show it even if standard error is no terminal
};
/// Prints what the motion is and how wrong it may be. An interrupted search goes on where it was.
int run_reference(const Scene& scene, const ReferenceOptions& options);

/// In `file`, or without one the cache's of this scene, if it has any. Throws Error for a file of another
/// scene.
std::optional<Motion> right_motion(const Model& model, const Settings& settings,
                                   const std::filesystem::path& file = {});
/// Of rigid bodies, found at once; nothing for scenes that are not theirs.
std::optional<Motion> rigid_motion(const Model& model, const Settings& settings, long steps);
/// Puts it there, over so many steps at least, if it is not. Throws Error for scenes without one.
void require_motion(const Scene& scene, const Model& model, long steps);
/// That of the scene's bodies on finer meshes (truth.h), found if it is not in the cache; of the first body on `mesh`,
/// if named.
std::shared_ptr<const Truth> require_truth(const Scene& scene, long steps, const std::filesystem::path& mesh);

}  // namespace tetpbd
