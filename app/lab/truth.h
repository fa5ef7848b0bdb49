// The motion of a scene's bodies on finer meshes, by which `compare --judge total` tells what meshes are worth.
#pragma once

#include <filesystem>

#include "app/scene.h"

namespace tetpbd {

/// The scene with the meshes of its truth, which depend on the bodies' shapes alone and not on how fine the scene's own
/// are: by TetGen, or lattices where that refuses or fills poorly; or `mesh`, if named, in place of the first body's.
/// Throws Error for sheets, random starts and random masses, which are other ones on another mesh.
Scene finer_scene(Scene scene, const std::filesystem::path& mesh = {});

}  // namespace tetpbd
