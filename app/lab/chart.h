// Charts as SVG text: points and lines over axes with units, linear from 0 or by decades.
#pragma once

#include <filesystem>
#include <glm/glm.hpp>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace tetpbd {

struct Series {
  std::string name, colour;
  enum Style { markers, line, dashes } style = markers;
  std::vector<glm::dvec2> points{};
};

struct Chart {
  std::string title, subtitle, x_label, y_label;
  bool log_x = false, log_y = false;
  std::vector<Series> series{};
  struct Note {
    glm::dvec2 at;
    std::string text;
  };
  std::vector<Note> notes{};
  /// Of pages: what shows a row of their table under the cursor.
  struct Spot {
    glm::dvec2 at;
    std::size_t row;
  };
  std::vector<Spot> spots{};
};

/// Text of HTML and SVG.
std::string escaped(const std::string& text);
std::string to_svg(const Chart& chart);

/// Okabe and Ito's: told apart with any colour vision. A solver mode has the same everywhere.
std::string palette_colour(std::size_t index);
std::string mode_colour(const std::string& mode);

/// From right (0) to wrong (1), linear in between decades from 10^-4 % to 100 %: sRGB; grey for what is not
/// known.
glm::dvec3 heat(double part);
double heat_part(double percent);

/// Cells of two settings as `tetpbd map` found them, coloured by decades of the error of the motion (of the
/// largest volume loss where no reference motion is known); those that failed say at which step.
std::string map_svg(const nlohmann::ordered_json& document);

/// Writes NAME.svg and, with rsvg-convert, NAME.png; says on standard error when that is missing.
void write_svg(const std::filesystem::path& name, const std::string& svg);

}  // namespace tetpbd
