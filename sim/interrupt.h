// SIGINT and SIGTERM set a flag that long work tests between its parts, so that files stay whole.
#pragma once

#include <chrono>
#include <csignal>

#include "sim/error.h"

namespace tetpbd {

namespace signals {
inline volatile std::sig_atomic_t caught = 0;
inline std::chrono::steady_clock::time_point first;

// The program `timeout` signals its child and then its child's group, so two signals within 0.2 s count as one.
inline void catch_one(int signal) {
  const auto now = std::chrono::steady_clock::now();
  if (!caught) {
    first = now;
    caught = 1;
  } else if (now - first > std::chrono::milliseconds(200)) {
    std::signal(signal, SIG_DFL);
    std::raise(signal);
  }
}
}  // namespace signals

/// From now on the first signal only sets the flag; a second one ends the program at once.
inline void catch_interrupts() {
  signals::caught = 0;
  for (const int signal : {SIGINT, SIGTERM}) std::signal(signal, signals::catch_one);
}
inline bool interrupted() { return signals::caught != 0; }

/// Thrown by a measurement, which is worth nothing unless it is complete.
struct Interrupted : Error {
  Interrupted() : Error("interrupted", "while measuring", "what was finished is written", 1) {}
};

}  // namespace tetpbd
