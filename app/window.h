// The window: GLFW and Dear ImGui around one simulation.
#pragma once

#include <string>

#include "app/scene.h"
#include "render/renderer.h"

namespace tetpbd {

struct WindowOptions {
  std::string scene_name;    ///< as given: a name or a file
  SceneOverrides overrides;  ///< stay in force when the same scene is reset
  int width = 1280, height = 720, samples = 4;
  ViewOptions view;
};

/// Until the window is closed. Exit status.
int run_window(const Scene& scene, const WindowOptions& options);

}  // namespace tetpbd
