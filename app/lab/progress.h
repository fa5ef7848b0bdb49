// What is said on standard error while something long goes on.
#pragma once

#include <chrono>
#include <functional>
#include <limits>
#include <string>

namespace tetpbd {

inline double seconds_since(std::chrono::steady_clock::time_point begin) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

/// On standard error, even where nothing can be written there.
void print_error(const std::string& line);
/// For count_gl_errors().
void print_gl_error(const char* text);

/// A line on standard error that is written over, on a terminal or if forced; elsewhere a new one every so
/// many seconds. `quiet`: s before the first.
struct Progress {
  std::string label;
  long total;
  bool bar;
  double every;
  std::chrono::steady_clock::time_point start = std::chrono::steady_clock::now(), last;

  Progress(const std::string& of, long steps, bool force = false,
           double lines_every = std::numeric_limits<double>::infinity(), double quiet = 0);
  ~Progress();
  void update(long done);
};

/// FillOptions::progress for this file: says how far its lattice is, if it takes longer than two seconds.
std::function<void(double)> fill_progress(const std::string& file);

}  // namespace tetpbd
