// A GL context for a test case: EGL, debug; any GL error fails the test.
#pragma once

#include <doctest/doctest.h>

#include <vector>

#include "sim/measure/metrics.h"

/// The modes that take bodies without compliance.
inline std::vector<tetpbd::SolverMode> pbd_modes() {
  auto modes = tetpbd::solver_modes();
  std::erase_if(modes, [](const tetpbd::SolverMode& mode) { return mode.forces; });
  return modes;
}

namespace tetpbd {

/// Measures now and waits.
inline Measurement measure_now(Metrics& metrics, const Sim& sim) {
  while (collect(metrics, true)) {
  }
  measure(metrics, sim);
  return *collect(metrics, true);
}

}  // namespace tetpbd

struct GlTest {
  tetpbd::HeadlessContext context{-1, true};
  int errors = tetpbd::gl_error_count();
  GlTest() {
    tetpbd::count_gl_errors([](const char* text) { MESSAGE("GL error: ", std::string(text)); });
  }
  ~GlTest() { CHECK(tetpbd::gl_error_count() == errors); }
};
