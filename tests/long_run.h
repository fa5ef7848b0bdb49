// What ./test.sh --long does more of than ./test.sh, and what it writes down.
#pragma once

#include <cstdlib>
#include <fstream>

/// In ./test.sh --long: tests then take all values, sizes and steps of which they else take a sample.
inline bool is_long_run() { return std::getenv("TETPBD_LONG") != nullptr; }

/// A test's own seed, shifted by that of the long run, so that each run can look at other random numbers.
inline unsigned seed_of_run(unsigned own) {
  const char* shift = std::getenv("TETPBD_SEED");
  return own + (shift ? unsigned(std::atoi(shift)) : 0u);
}

/// The long run keeps the largest value of each name, and the most that passes, in docs/data/long-suite.json.
/// TETPBD_LONG names the file where they are collected.
inline void record_worst(const char* what, double value, double most) {
  if (!is_long_run()) return;
  std::ofstream(std::getenv("TETPBD_LONG"), std::ios::app) << what << '\t' << value << '\t' << most << '\n';
}
