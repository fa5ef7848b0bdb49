#include "sim/mesh/tetgen_switches.h"

#include <fmt/format.h>

#include <string_view>

#include "sim/error.h"

namespace tetpbd {
namespace {

bool is_digit(char c) { return (c >= '0' && c <= '9') || c == '.'; }

// A switch's numbers as TetGen reads them: "1.85", "1e-6", "/140", "1.414/18".
std::string_view take_numbers(std::string_view& rest) {
  std::size_t n = 0;
  while (n < rest.size()) {
    const bool begins = is_digit(rest[n]) || (rest[n] == '/' && n + 1 < rest.size());
    const bool goes_on = n > 0 && is_digit(rest[n - 1]) && rest[n] == 'e';
    const bool sign = n > 0 && rest[n - 1] == 'e' && (rest[n] == '-' || rest[n] == '+');
    if (!begins && !goes_on && !sign) break;
    ++n;
  }
  const std::string_view numbers = rest.substr(0, n);
  rest.remove_prefix(n);
  return numbers;
}

}  // namespace

std::string checked_switches(const std::string& switches) {
  const std::string where = fmt::format("TetGen switches '{}'", switches);
  const auto refuse = [&](const std::string& what, const char* mend) { throw Error(what, where, mend); };
  std::string clean = switches.starts_with('-') ? switches.substr(1) : switches;
  if (clean.size() > 200) refuse("too long", "give a few switches, such as pYq1.85o/140");
  std::string_view rest = clean;
  bool plc = false, quiet = false;
  while (!rest.empty()) {
    const char letter = rest.front();
    rest.remove_prefix(1);
    const std::string_view numbers = take_numbers(rest);
    switch (letter) {
      case 'p':
        plc = true;
        break;
      case 'Q':
        quiet = true;
        break;
      case 'Y':
      case 'q':
      case 'O':
      case 'S':
      case 'T':
      case 'M':
      case 'X':
      case 'A':
      case 'V':
      case 'C':
      case 'D':
      case 'L':
      case 'l':
      case 'b':
      case 'x':
      case 'z':
      case 'J':
        break;
      case 'a':
        if (numbers.empty())
          refuse("'a' without a number needs a file of volumes",
                 "give the largest volume, such as a1e-6 (m^3)");
        break;
      case 'o':
        if (!numbers.starts_with('/'))
          refuse("'o' makes second-order tets", "for a largest dihedral angle write o/140");
        break;
      case 'r':
      case 'R':
      case 'i':
      case 'm':
      case 'w':
      case 's':
      case 'd':
      case 'c':
        refuse(fmt::format("'{}' does something else than mesh a surface", letter),
               "leave it out: a mesh here is one surface, filled");
        break;
      case 'f':
      case 'e':
      case 'n':
      case 'v':
      case 'g':
      case 'k':
      case 'B':
      case 'N':
      case 'E':
      case 'F':
      case 'I':
      case 'h':
        refuse(fmt::format("'{}' is about TetGen's own files", letter),
               "leave it out: use --out to write the mesh");
        break;
      default:
        refuse(fmt::format("there is no switch '{}'", letter),
               "see docs/meshes.md, for example pYq1.85o/140");
    }
  }
  if (!plc) refuse("'p' is missing", "a surface is meshed with p, for example pY or pYq1.85o/140");
  return quiet ? clean : clean + "Q";
}

}  // namespace tetpbd
