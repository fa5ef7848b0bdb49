// Places in the GPU's queue, and the time between two of them.
#pragma once

#include <deque>
#include <optional>
#include <vector>

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
  void begin();
  void end();
  /// Milliseconds of the oldest finished span, if any; with `wait`, of the oldest span begun and ended.
  std::optional<double> poll(bool wait = false);

 private:
  using Query = Owned<GLuint, delete_query>;
  struct Span {
    Query begin, end;
    bool ended = false;
  };
  std::vector<Span> free_;
  std::deque<Span> pending_;
};

}  // namespace tetpbd
