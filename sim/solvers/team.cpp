#include "sim/solvers/team.h"

namespace tetpbd {

Team::Team(unsigned size) : size_(size) {
  for (unsigned n = 1; n < size_; ++n)
    others_.emplace_back([this, n] {
      for (unsigned seen = 0;; ++seen) {
        runs_.wait(seen);
        if (!work_) return;
        (*work_)(n);
        meet();
      }
    });
}

Team::~Team() {
  work_ = nullptr;
  ++runs_;
  runs_.notify_all();
}

void Team::run(const std::function<void(unsigned)>& work) {
  work_ = &work;
  ++runs_;
  runs_.notify_all();
  work(0);
  meet();
}

void Team::meet() {
  const unsigned meeting = meetings_;
  if (++arrived_ == size_) {
    arrived_ = 0;
    ++meetings_;
    return;
  }
  // Where threads share a core, the one waited for needs it.
  for (int looks = 0; meetings_ == meeting; ++looks)
    if (looks > 2000) std::this_thread::yield();
}

}  // namespace tetpbd
