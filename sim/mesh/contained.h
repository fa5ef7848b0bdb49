// Runs work that may crash, hang or eat memory (third-party readers, TetGen) in a child process of its own.
#pragma once

#include <cstddef>
#include <functional>
#include <string>

namespace tetpbd {

struct ContainedLimits {
  double seconds = 60;                       ///< wall clock
  std::size_t bytes = std::size_t{4} << 30;  ///< on top of what the parent has mapped when it forks
};

struct ContainedResult {
  enum class End { done, refused, timed_out, died };
  End end = End::died;
  std::string bytes;   ///< what the work returned (done)
  std::string reason;  ///< what the work threw (refused), or how the child ended (timed_out, died)
};

/// Forks, runs `work` in the child and returns its bytes. The child's standard output and error go to
/// /dev/null, it dies with the parent, and it is always reaped. `work` must touch no GL: only the calling
/// thread exists in the child. An exception from `work` comes back as `refused` with its text; any abnormal
/// end as `died`.
ContainedResult run_contained(const std::function<std::string()>& work, const ContainedLimits& limits);

}  // namespace tetpbd
