#include "app/lab/progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <memory>

namespace tetpbd {

using std::chrono::steady_clock;

void print_error(const std::string& line) {
  std::fputs(line.c_str(), stderr);  // fmt::print() throws
  std::fflush(stderr);
}

void print_gl_error(const char* text) { print_error(fmt::format("GL error: {}\n", text)); }

Progress::Progress(const std::string& of, long steps, bool force, double lines_every, double quiet)
    : label(of), total(steps), bar(force || isatty(2)), every(bar ? 0.1 : lines_every) {
  if (quiet > 0)
    last = start + std::chrono::duration_cast<steady_clock::duration>(std::chrono::duration<double>(quiet - every));
  else if (!bar)
    last = start;
}

Progress::~Progress() {
  if (bar) print_error("\r\033[K");
}

void Progress::update(long done) {
  if (seconds_since(last) < every) return;
  last = steady_clock::now();
  const double left = seconds_since(start) * double(total - done) / double(done);
  print_error(fmt::format("{}{} {} of {}{}{}", bar ? "\r\033[K" : "", label, done, total,
                          done > 0 ? fmt::format(", {:.0f} s left", left) : "", bar ? "" : "\n"));
}

std::function<void(double)> fill_progress(const std::string& file) {
  const auto progress = std::make_shared<Progress>("filling " + file + ", per cent:", 100, false, 10, 2);
  return [progress](double part) { progress->update(std::lround(100 * part)); };
}

}  // namespace tetpbd
