#include "sim/interrupt.h"

#include <csignal>
#include <ctime>

namespace tetpbd {
namespace {

volatile std::sig_atomic_t caught = 0;
timespec first;

// `timeout` signals its child, then its child's group: that is one wish in two signals, a moment apart.
void on_signal(int signal) {
  timespec now;
  ::clock_gettime(CLOCK_MONOTONIC, &now);
  if (!caught) {
    first = now;
    caught = 1;
  } else if (double(now.tv_sec - first.tv_sec) + 1e-9 * double(now.tv_nsec - first.tv_nsec) > 0.2) {
    std::signal(signal, SIG_DFL);
    ::raise(signal);
  }
}

}  // namespace

void catch_interrupts() {
  caught = 0;
  std::signal(SIGINT, on_signal);
  std::signal(SIGTERM, on_signal);
}

bool interrupted() { return caught != 0; }

}  // namespace tetpbd
