// SIGINT and SIGTERM as a flag that long work looks at between its parts, so that files stay whole.
#pragma once

#include "sim/error.h"

namespace tetpbd {

/// From here on the first signal only sets the flag; a second one ends the program at once.
void catch_interrupts();
bool interrupted();

/// Thrown out of a measurement, which is nothing when it is not whole.
struct Interrupted : Error {
  Interrupted() : Error("interrupted", "while measuring", "what was finished is written", 1) {}
};

}  // namespace tetpbd
