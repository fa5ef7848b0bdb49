// A barrier for the threads of a parallel region that wait for each other some hundred times a step.
#pragma once

#include <atomic>
#include <exception>
#include <thread>
#include <vector>

namespace tetpbd {

/// Each thread writes a count of its own and watches those of the others for a while before it yields.
class Barrier {
 public:
  explicit Barrier(std::size_t most) : threads(most), arrivals_(most) {}
  std::size_t threads;  ///< at most as many as it was made for

  /// Does a thread's work and catches what it throws, because no exception may leave a parallel region. A thread that
  /// fails ends the waiting of the others; rethrow() then throws what the first one threw.
  template <class Work>
  void run(Work&& work) noexcept {
    try {
      work();
    } catch (const Abandoned&) {
    } catch (...) {
#pragma omp critical(barrier_failure)
      if (!failure_) failure_ = std::current_exception();
      failed_.store(true, std::memory_order_release);
    }
  }
  void rethrow() const {
    if (failure_) std::rethrow_exception(failure_);
  }
  void wait(std::size_t thread) {
    if (threads == 1) return;
    const unsigned now = arrivals_[thread].count.load(std::memory_order_relaxed) + 1;
    arrivals_[thread].count.store(now, std::memory_order_release);
    int looks = 0;
    for (std::size_t other = 0; other < threads; ++other)
      while (int(arrivals_[other].count.load(std::memory_order_acquire) - now) < 0) {
        if (failed_.load(std::memory_order_acquire)) throw Abandoned();
        if (++looks > 4000) std::this_thread::yield();
      }
  }

 private:
  struct Abandoned {};
  struct alignas(64) Arrivals {
    std::atomic<unsigned> count = 0;
  };
  std::vector<Arrivals> arrivals_;  // by thread
  std::atomic<bool> failed_ = false;
  std::exception_ptr failure_;
};

}  // namespace tetpbd
