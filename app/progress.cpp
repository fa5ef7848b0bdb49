#include "app/progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>

namespace tetpbd {

using Clock = std::chrono::steady_clock;

Progress::Progress(std::string label, long total, bool force)
    : label_(std::move(label)),
      total_(total),
      shown_(force || isatty(2)),
      start_(Clock::now()),
      last_(start_ - std::chrono::seconds(1)) {}

Progress::~Progress() {
  if (drawn_) std::fputs("\r\033[K", stderr);
}

void Progress::update(long done) {
  const auto now = Clock::now();
  if (!shown_ || (now - last_ < std::chrono::milliseconds(100) && done != total_)) return;
  last_ = now;
  drawn_ = true;
  const double part = total_ > 0 ? double(done) / double(total_) : 1.0;
  const double elapsed = std::chrono::duration<double>(now - start_).count();
  const int filled = int(part * 30);
  const std::string bar = std::string(std::size_t(filled), '#') + std::string(std::size_t(30 - filled), '.');
  const std::string line = fmt::format("\r\033[K{} [{}] {}/{}  {:.0f} s left", label_, bar, done, total_,
                                       part > 0 ? elapsed * (1 - part) / part : 0.0);
  std::fputs(line.c_str(), stderr);  // fmt::print() throws where nothing can be written
  std::fflush(stderr);
}

}  // namespace tetpbd
