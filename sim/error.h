// Errors a user can cause or mend: one line "WHAT: WHERE: MEND", printed by main as "tetpbd: ...".
#pragma once

#include <stdexcept>
#include <string>

namespace tetpbd {

/// Exit status 2: bad input or usage; 1: it ran and something failed.
struct Error : std::runtime_error {
  Error(const std::string& what, const std::string& where, const std::string& mend, int status = 2)
      : std::runtime_error(what + ": " + where + ": " + mend), exit_status(status) {}
  int exit_status;
};

/// The GPU was reset and everything on it is lost: nothing but ending the program is left.
struct ContextLost : Error {
  using Error::Error;
};

}  // namespace tetpbd
