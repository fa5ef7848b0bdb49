// Runs another program with limits on its time and memory.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace tetpbd {

struct SubprocessLimits {
  double seconds;                              ///< wall clock
  std::size_t bytes = std::size_t{16} << 30;   ///< of memory
  std::size_t output = std::size_t{64} << 20;  ///< bytes; the rest is dropped
};

struct SubprocessEnd {
  enum Kind { done, timed_out, not_started, failed } kind;
  std::string output;  ///< what it printed
  std::string reason;  ///< how it failed
};

/// `arguments`: the program first, found in PATH when it is a plain name. It dies with its parent and is
/// always reaped. Throws Error when the user interrupts.
SubprocessEnd run_subprocess(const std::vector<std::string>& arguments, const SubprocessLimits& limits);

}  // namespace tetpbd
