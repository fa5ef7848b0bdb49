#include "app/window/step_thread.h"

#include <GLFW/glfw3.h>

#include <algorithm>
#include <chrono>
#include <utility>

#include "app/lab/progress.h"
#include "sim/error.h"
#include "sim/gl/context.h"

namespace tetpbd {

StepThread::StepThread(GLFWwindow* window, bool turns) : turns_(turns) {
  glfwWindowHint(GLFW_VISIBLE, GLFW_FALSE);
  context_ = glfwCreateWindow(1, 1, "tetpbd steps", nullptr, window);
  glfwWindowHint(GLFW_VISIBLE, GLFW_TRUE);
  if (!context_) throw Error("no second OpenGL context", "slow steps will stop the window", "use a newer driver", 1);
  for (Pass& idle : idle_) idle = {Program::compute("idle.comp"), 1};
  if (turns_) turn_.lock();
  thread_ = std::thread([this] { run(); });
}

StepThread::~StepThread() {
  {
    const std::lock_guard lock(mutex_);
    ends_ = true;
  }
  changed_.notify_all();
  if (turns_) turn_.unlock();
  thread_.join();
  glfwDestroyWindow(context_);
}

void StepThread::start(std::function<void()> work) {
  {
    const std::lock_guard lock(mutex_);
    queued_ = Fence::here();
    glFlush();  // or the other context would wait for a fence that never comes
    given_up_ = false;
    work_ = std::move(work);
  }
  changed_.notify_all();
}

bool StepThread::wait(double seconds) {
  if (turns_) turn_.unlock();
  std::exception_ptr thrown;
  bool done = false;
  {
    std::unique_lock lock(mutex_);
    constexpr double longest = 1e6;  // s; more overflows the clock
    done = changed_.wait_for(lock, std::chrono::duration<double>(std::min(seconds, longest)), [&] { return !work_; });
    if (done) thrown = std::exchange(thrown_, nullptr);
  }
  if (turns_) turn_.lock();
  if (thrown) std::rethrow_exception(thrown);
  return done;
}

// Mesa (seen in 22.3) crashes where one context deletes a kernel that another has used last: that one keeps the kernel
// until it uses the next, and what it then lets go of unbinds, in the first context's next flush, whatever kernel that
// has used last, which is not bound anew if it is dispatched again. So the last kernel before and after work is none of
// the window's, and never the same twice.
void StepThread::rest() {
  recorder_.begin();
  recorder_.run(idle_[next_idle_]);
  next_idle_ = 1 - next_idle_;
}

void StepThread::run() {
  if (turns_) gl_turn = &turn_, turn_.lock();
  glfwMakeContextCurrent(context_);
  count_gl_errors(print_gl_error);
  if (turns_) turn_.unlock();
  std::unique_lock lock(mutex_);
  for (;;) {
    changed_.wait(lock, [&] { return work_ || ends_; });
    if (ends_) break;
    Fence queued = std::exchange(queued_, {});
    lock.unlock();
    if (turns_) turn_.lock();
    std::exception_ptr thrown;
    const auto keep_thrown = [&](const auto& act) {
      try {
        act();
      } catch (...) {
        if (!thrown) thrown = std::current_exception();
      }
    };
    keep_thrown([&] {
      rest();
      glFlush();
      glWaitSync(queued.sync(), 0, GL_TIMEOUT_IGNORED);
      work_();
    });
    keep_thrown([&] { rest(); });
    glFinish();  // what another context shows must be there
    queued = {};
    if (turns_) turn_.unlock();
    lock.lock();
    thrown_ = thrown, work_ = {};
    changed_.notify_all();
  }
  glfwMakeContextCurrent(nullptr);
}

}  // namespace tetpbd
