// Places in the GPU's queue, and the time between two of them.
#pragma once

#include <deque>
#include <optional>

#include "sim/gl/object.h"

namespace tetpbd {

/// Whether the GPU has come to the fence; with `wait`, once it has. Where waiting fails: ContextLost, or an
/// Error that names what was waited for.
bool reached(GLsync fence, bool wait, const char* what);

inline void delete_fence(GLsync sync) { glDeleteSync(sync); }
inline void delete_query(GLuint id) { glDeleteQueries(1, &id); }

/// A place in the GPU's queue.
struct Fence : Owned<GLsync, delete_fence> {
  using Owned::Owned;
  static Fence here() { return Fence(glFenceSync(GL_SYNC_GPU_COMMANDS_COMPLETE, 0)); }
  GLsync sync() const { return name(); }
};

/// GPU time between begin and end by pairs of timestamps, read back when ready (never waits unless asked).
class Timer {
 public:
  void begin() { begun_ = now(); }
  void end() { spans_.emplace_back(std::move(begun_), now()); }
  /// Milliseconds of the oldest span that is ready, if any; with `wait`, of the oldest there is.
  std::optional<double> poll(bool wait = false);

 private:
  using Query = Owned<GLuint, delete_query>;
  static Query now();
  Query begun_;
  std::deque<std::pair<Query, Query>> spans_;
};

}  // namespace tetpbd
