// What a caller has bound stays bound across a call into sim.
#pragma once

#include <GL/glew.h>

#include <array>

namespace tetpbd {

/// Stands first in the functions that callers use and that touch GL: reads bindings when it is made, and puts
/// them back when it ends. Kept are the program in use, the active texture unit, the buffer texture of that
/// unit and of UNIT_FIELDS, and the buffer of each generic target that sim binds. A step of sim touches
/// nothing else but the indexed buffers, which are too many to ask for. Also loads GL functions if nobody
/// has, and throws Error where no context is current.
class KeepBindings {
 public:
  KeepBindings();
  ~KeepBindings();
  KeepBindings(const KeepBindings&) = delete;
  KeepBindings& operator=(const KeepBindings&) = delete;

 private:
  GLint program_ = 0, unit_ = 0;
  std::array<GLint, 2> textures_{};  ///< of the active unit, of UNIT_FIELDS
  std::array<GLint, 6> buffers_{};
};

}  // namespace tetpbd
