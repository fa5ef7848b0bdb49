// A GL context for a test case: EGL, debug; any GL error fails the test.
#pragma once

#include <doctest/doctest.h>

#include "sim/gl/context.h"

struct GlTest {
  tetpbd::HeadlessContext context{-1, true};
  int errors = tetpbd::gl_error_count();
  ~GlTest() { CHECK(tetpbd::gl_error_count() == errors); }
};
