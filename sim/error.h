// Errors that a user can cause or repair: one line "WHAT: WHERE: REPAIR", which main prints after "tetpbd: ".
#pragma once

#include <stdexcept>
#include <string>

namespace tetpbd {

/// For one line on a terminal: control characters, such as those of a file's name or content, become '?'.
inline std::string printable(std::string text) {
  for (char& c : text)
    if (static_cast<unsigned char>(c) < ' ' || c == '\x7f') c = '?';
  return text;
}

/// Exit status 2: bad input or usage; 1: the program ran and something failed.
struct Error : std::runtime_error {
  Error(const std::string& what, const std::string& where, const std::string& repair, int status = 2)
      : std::runtime_error(part(what) + ": " + part(where) + ": " + part(repair)), exit_status(status) {}
  int exit_status;

 private:
  // What is quoted from a file may be as long as the file.
  static std::string part(const std::string& text) {
    return printable(text.size() > 1000 ? text.substr(0, 997) + "..." : text);
  }
};

/// The GPU was reset and everything on it is lost, so the program can only end.
struct ContextLost : Error {
  using Error::Error;
};

}  // namespace tetpbd
