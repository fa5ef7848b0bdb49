// A thread that takes the steps that last longer than a frame may. It has a GL context of its own, which shares the
// window's objects, so that the panel and the camera answer meanwhile.
#pragma once

#include <array>
#include <atomic>
#include <condition_variable>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>

#include "sim/gl/pass.h"

struct GLFWwindow;

namespace tetpbd {

class StepThread {
 public:
  /// To be made and destroyed by the main thread, the latter while idle. With `turns`, the two take turns to call GL:
  /// this one whenever the main thread waits. Throws Error without a second context.
  StepThread(GLFWwindow* window, bool turns);
  ~StepThread();
  StepThread(const StepThread&) = delete;
  StepThread& operator=(const StepThread&) = delete;
  /// Begins work, once the GPU has done what this context has queued so far. Only while idle.
  void start(std::function<void()> work);
  /// Waits for at most so many seconds until the work is done, on the GPU as well; then what it threw is thrown here.
  bool wait(double seconds);
  /// Asks the work to end early, until the next start.
  void give_up() { given_up_ = true; }
  bool is_given_up() const { return given_up_; }

 private:
  void run();
  void rest();
  GLFWwindow* context_ = nullptr;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::function<void()> work_;  // none: idle
  Fence queued_;
  std::exception_ptr thrown_;
  Turn turn_;
  bool turns_;
  bool ends_ = false;
  std::atomic<bool> given_up_ = false;
  Recorder recorder_;
  std::array<Pass, 2> idle_;  // kernels that do nothing
  std::size_t next_idle_ = 0;
  std::thread thread_;
};

}  // namespace tetpbd
