#include "sim/parallel.h"

#include <atomic>

namespace tetpbd {

namespace {
std::atomic<unsigned> given = 0;
}

unsigned thread_count() {
  constexpr unsigned most = 16;
  const unsigned count = given;
  return count > 0 ? count : std::clamp(std::thread::hardware_concurrency(), 1u, most);
}

void set_thread_count(unsigned count) { given = count; }

}  // namespace tetpbd
