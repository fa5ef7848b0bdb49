// Leaves a caller's bindings as they were across a call into sim.
#pragma once

#include <GL/glew.h>

#include <array>

namespace tetpbd {

/// Stands first in functions that callers use and that touch GL. Keeps the program in use, the active texture unit, the
/// buffer texture of that unit and of those that sim uses (UNIT_... in layout.glsl), and the buffer of each generic
/// target that sim binds (sim.h). Also loads GL functions if nobody has, and throws Error where no context is current.
class KeepBindings {
 public:
  KeepBindings();
  ~KeepBindings();
  KeepBindings(const KeepBindings&) = delete;
  KeepBindings& operator=(const KeepBindings&) = delete;

 private:
  GLint program_ = 0, unit_ = 0;
  GLint texture_ = 0;                ///< of the active unit
  std::array<GLint, 5> textures_{};  ///< of the units that sim uses
  std::array<GLint, 6> buffers_{};
};

}  // namespace tetpbd
