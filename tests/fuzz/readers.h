// Everything that reads what a user gives, as functions of bytes: for the fuzzers, and for the test that
// replays their corpus.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace fuzz {

struct Reader {
  const char* name;
  const char* corpus;  ///< folder in tests/corpus
  void (*read)(std::string_view bytes);
  bool forks;  ///< starts a program, so a run takes milliseconds
};

/// Each returns whether it liked the bytes or not, and ends the process with a message where it broke a
/// promise: an exception that is no Error, an Error of more than one line, a result that is no mesh.
const std::vector<Reader>& readers();

}  // namespace fuzz
