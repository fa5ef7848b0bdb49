// A few threads that do one piece of work together, for work of microseconds: they wait for each other
// spinning.
#pragma once

#include <atomic>
#include <functional>
#include <thread>
#include <vector>

namespace tetpbd {

class Team {
 public:
  explicit Team(unsigned size);  ///< the caller of run() is one of them
  ~Team();
  Team(const Team&) = delete;
  Team& operator=(const Team&) = delete;

  unsigned size() const { return size_; }
  /// work(n) on each member n; returns when all have. `work` must not throw.
  void run(const std::function<void(unsigned)>& work);
  /// Of `work`: returns when every member is here.
  void meet();
  /// Of `count` things, where member n's share begins; it ends where that of n + 1 begins.
  std::size_t share(std::size_t count, unsigned n) const { return count * n / size_; }

 private:
  unsigned size_;
  const std::function<void(unsigned)>* work_ = nullptr;  // none: the end
  std::atomic<unsigned> runs_{0}, arrived_{0}, meetings_{0};
  std::vector<std::jthread> others_;
};

}  // namespace tetpbd
