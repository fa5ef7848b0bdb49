// Charts as SVG text: axes with units, log scales, one colour a solver mode everywhere.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace tetpbd {

struct Series {
  std::string name, colour;
  std::vector<double> x, y;
  bool line = true, markers = true, dashed = false;
};

struct Chart {
  std::string title, subtitle, x_label, y_label;
  bool log_x = false, log_y = false;
  std::vector<Series> series{};
  struct Note {
    double x, y;
    std::string text;
  };
  std::vector<Note> notes{};
  /// Bars instead, in groups, one a series in each: y by group, NaN leaves a gap.
  std::vector<std::string> groups{};
};

std::string to_svg(const Chart& chart);

/// The colour of a solver mode; palette_colour(k): of anything else, in order.
std::string mode_colour(const std::string& mode);
std::string palette_colour(std::size_t index);

/// Writes NAME.svg and, with rsvg-convert, NAME.png; says on standard error when that is missing.
void write_chart(const std::filesystem::path& name, const std::string& svg);

}  // namespace tetpbd
