// A progress bar on standard error, on a terminal only unless forced.
#pragma once

#include <chrono>
#include <string>

namespace tetpbd {

class Progress {
 public:
  Progress(std::string label, long total, bool force = false);
  ~Progress();
  void update(long done);

 private:
  std::string label_;
  long total_;
  bool shown_;
  bool drawn_ = false;
  std::chrono::steady_clock::time_point start_, last_;
};

}  // namespace tetpbd
