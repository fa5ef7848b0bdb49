#include "app/lab/chart.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "app/lab/map.h"
#include "app/lab/run.h"
#include "app/lab/sweep.h"
#include "sim/error.h"
#include "sim/files.h"
#include "sim/mesh/subprocess.h"
#include "sim/solvers/solver.h"

namespace tetpbd {

std::string escaped(const std::string& text) {
  std::string result;
  for (const char c : text)
    result += c == '<' ? "&lt;" : c == '>' ? "&gt;" : c == '&' ? "&amp;" : c == '"' ? "&quot;" : std::string(1, c);
  return result;
}

namespace {

constexpr double width = 860, height = 520, left = 86, right = width - 210, top = 66, bottom = height - 62;

std::string text(double x, double y, const std::string& what, const char* anchor = "start", double size = 12,
                 const std::string& more = "") {
  return fmt::format(
      "<text x=\"{:.1f}\" y=\"{:.1f}\" font-size=\"{}\" text-anchor=\"{}\" fill=\"#222222\" {}>{}</text>\n", x, y, size,
      anchor, more, escaped(what));
}

std::string head(const std::string& title, const std::string& subtitle, const std::string& x_label,
                 const std::string& y_label) {
  constexpr double middle = (top + bottom) / 2;
  return fmt::format(
             "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0} {1}\" width=\"{0}\" height=\"{1}\" "
             "font-family=\"DejaVu Sans, Helvetica, Arial, sans-serif\">\n"
             "<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n",
             width, height) +
         text(left, 28, title, "start", 17, "font-weight=\"bold\"") + text(left, 48, subtitle) +
         text((left + right) / 2, height - 18, x_label, "middle", 13) +
         text(22, middle, y_label, "middle", 13, fmt::format("transform=\"rotate(-90 22 {})\"", middle));
}

std::string path(const std::string& points, const std::string& style = "stroke=\"#dddddd\"") {
  return fmt::format("<path d=\"{}\" {}/>\n", points, style);
}

struct Axis {
  bool log;
  double from, to;  ///< on the paper
  double low = 1, high = 10;
  bool shows(double value) const { return std::isfinite(value) && (!log || value > 0); }
  double at(double value) const {
    const double part = log ? std::log(value / low) / std::log(high / low) : (value - low) / (high - low);
    return from + part * (to - from);
  }
};

Axis fit(const Chart& chart, int component, double from, double to) {
  Axis axis{component == 0 ? chart.log_x : chart.log_y, from, to};
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const Series& series : chart.series)
    for (const glm::dvec2& point : series.points)
      if (const double v = point[component]; axis.shows(v)) low = std::min(low, v), high = std::max(high, v);
  if (!(low <= high)) return axis;
  if (axis.log) {
    axis.low = std::pow(10, std::floor(std::log10(low) + 1e-9));
    axis.high = std::max(10 * axis.low, std::pow(10, std::ceil(std::log10(high) - 1e-9)));
  } else {
    axis.low = 1.05 * std::min(low, 0.0);
    axis.high = high > 0 ? 1.05 * high : axis.low < 0 ? 0 : 1;
  }
  return axis;
}

std::vector<double> ticks(const Axis& axis) {
  std::vector<double> result;
  if (axis.log) {
    for (double decade = axis.low; decade <= axis.high * 1.0001; decade *= 10)
      for (double m : {1.0, 2.0, 5.0})
        if (m == 1 || (axis.high < 1000 * axis.low && decade * m < axis.high)) result.push_back(decade * m);
    return result;
  }
  const double raw = (axis.high - axis.low) / 6, power = std::pow(10, std::floor(std::log10(raw)));
  const double parts = raw / power, step = power * (parts < 1.5 ? 1 : parts < 3.5 ? 2 : parts < 7.5 ? 5 : 10);
  for (double k = std::ceil(axis.low / step); k * step <= axis.high; ++k) result.push_back(k * step + 0.0);
  return result;
}

// Markers differ as well as colours, for print without colour.
constexpr std::array markers = {"m-4 0a4 4 0 1 0 8 0a4 4 0 1 0 -8 0", "m-3.7 -3.7h7.4v7.4h-7.4z", "m0 -5l4.6 8h-9.2z",
                                "m0 -5l5 5l-5 5l-5 -5z"};

constexpr double least_percent = 1e-4, decades = 6;

std::string heat_code(double part) {
  const glm::dvec3 c = 255.0 * heat(part);
  return fmt::format("#{:02x}{:02x}{:02x}", std::lround(c.x), std::lround(c.y), std::lround(c.z));
}

}  // namespace

std::string palette_colour(std::size_t index) {
  static constexpr std::array colours = {"#0072b2", "#d55e00", "#555555", "#009e73", "#cc79a7",
                                         "#e69f00", "#56b4e9", "#000000", "#882255", "#8c564b"};
  return colours[index % colours.size()];
}

std::string mode_colour(const std::string& mode) {
  // In every chart the same, baselines too; a mode that is not here has the colour after these.
  static const std::vector<std::string> order = {"node",  "constraint", "cpu",    "cpu-double", "cpu-fast",
                                                 "paper", "rigid-body", "direct", "explicit"};
  return palette_colour(std::size_t(std::ranges::find(order, mode) - order.begin()));
}

std::string to_svg(const Chart& chart) {
  const Axis x = fit(chart, 0, left, right), y = fit(chart, 1, bottom, top);
  const double middle = (top + bottom) / 2;
  std::string svg = head(chart.title, chart.subtitle, chart.x_label, chart.y_label);
  const auto tick = [](double v) {
    return std::abs(v) >= 10000 ? fmt::format("{:g}k", v / 1000) : fmt::format("{:g}", v);
  };
  for (double v : ticks(x))
    svg += path(fmt::format("M{:.1f} {}V{}", x.at(v), top, bottom)) + text(x.at(v), bottom + 18, tick(v), "middle");
  for (double v : ticks(y))
    svg += path(fmt::format("M{} {:.1f}H{}", left, y.at(v), right)) + text(left - 8, y.at(v) + 4, tick(v), "end");
  double legend = top + 10;
  bool empty = true;
  for (std::size_t k = 0; k < chart.series.size(); ++k, legend += 20) {
    const Series& s = chart.series[k];
    const bool line = s.style != Series::markers;
    const std::string marker = line ? "" : markers[k % markers.size()];
    const std::string style = line ? fmt::format("stroke=\"{}\" stroke-width=\"1.8\" fill=\"none\"{}", s.colour,
                                                 s.style == Series::dashes ? " stroke-dasharray=\"6 4\"" : "")
                                   : fmt::format("fill=\"{}\"", s.colour);
    std::string points;
    for (const glm::dvec2& p : s.points)
      if (x.shows(p.x) && y.shows(p.y))
        points += fmt::format("{}{:.1f} {:.1f}{}", line && !points.empty() ? "L" : "M", x.at(p.x), y.at(p.y), marker);
    empty = empty && points.empty();
    svg += path(points, style) + text(right + 44, legend + 4, s.name);
    svg += path(fmt::format("M{} {}{}", right + (line ? 14 : 26), legend, line ? "h24" : marker), style);
  }
  if (empty) svg += text((left + right) / 2, middle, "no value to draw: all are 0 or none is finite", "middle", 15);
  for (const Chart::Note& note : chart.notes)  // below and to the left, where a front leaves room
    if (x.shows(note.at.x) && y.shows(note.at.y))
      svg += text(x.at(note.at.x) - 7, y.at(note.at.y) + 14, note.text, "end", 10.5);
  for (const Chart::Spot& spot : chart.spots)
    if (x.shows(spot.at.x) && y.shows(spot.at.y))
      svg += fmt::format("<circle data-row=\"{}\" cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"8\" fill=\"transparent\"/>\n",
                         spot.row, x.at(spot.at.x), y.at(spot.at.y));
  return svg + "</svg>\n";
}

void write_svg(const std::filesystem::path& name, const std::string& picture) {
  // Absolute: a folder whose name begins with a dash is no option of rsvg-convert.
  const std::string whole = std::filesystem::absolute(name).string(), svg = whole + ".svg";
  write_file(svg, picture);
  const PartFile png(whole + ".png");
  const auto end = run_subprocess({"rsvg-convert", "-z", "1.5", "-o", png.part.string(), svg}, {60});
  if (end.kind == SubprocessEnd::done) return png.finish();
  print_error(
      fmt::format("tetpbd: no {}: rsvg-convert did not make it: install librsvg2-bin\n", printable(png.file.string())));
}

// Dark blue, green, yellow, red.
glm::dvec3 heat(double part) {
  constexpr std::array<glm::dvec3, 4> stops{
      {{0.19, 0.31, 0.58}, {0.20, 0.62, 0.49}, {0.95, 0.86, 0.35}, {0.84, 0.27, 0.20}}};
  if (!std::isfinite(part)) return glm::dvec3(0.733);
  const double at = std::clamp(part, 0.0, 1.0) * 3;
  const std::size_t first = std::min<std::size_t>(std::size_t(at), 2);
  return glm::mix(stops[first], stops[first + 1], at - double(first));
}

double heat_part(double percent) { return std::log10(std::max(percent, least_percent) / least_percent) / decades; }

std::string map_svg(const nlohmann::ordered_json& document) {
  const auto& rows = document["rows"];
  std::vector<std::string> xs, ys;
  bool motion = false;
  const auto note = [](auto& all, const std::string& value) {
    if (std::ranges::find(all, value) == all.end()) all.push_back(value);
    return std::size_t(std::ranges::find(all, value) - all.begin());
  };
  for (const auto& row : rows) {
    note(xs, row["x"]), note(ys, row["y"]);
    motion = motion || std::isfinite(number(row, "motion_rms"));
  }
  const double wide = (right - left) / double(xs.size()), high = (bottom - top) / double(ys.size());
  std::string svg = head(fmt::format("{}: {} against {}", document["scene"].get<std::string>(),
                                     document["y"].get<std::string>(), document["x"].get<std::string>()),
                         fmt::format("mode {}, {} tets, {:g} s: {}", document["mode"].get<std::string>(),
                                     document["tets"].get<long>(), document["seconds"].get<double>(),
                                     motion ? "distance from the reference motion over the run, % of the size"
                                            : "largest net volume loss, %"),
                         document["x"], document["y"]);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const auto& row = rows[i];
    const double x = left + double(note(xs, row["x"])) * wide, y = bottom - double(note(ys, row["y"]) + 1) * high;
    const double percent = map_percent(row, motion);
    const bool failed = !row["finite"].get<bool>();
    const double part = heat_part(percent);
    const std::string said = row.contains("refused") ? "refused"
                             : failed                ? fmt::format("fails at {}", text_of(row["failed_at_step"]))
                             : std::isfinite(percent)
                                 ? fmt::format(fmt::runtime(percent < 9.95 ? "{:.2g}" : "{:.0f}"), percent)
                                 : "";
    svg += fmt::format(
        "<rect data-row=\"{}\" x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"{}\" "
        "stroke=\"white\"/>\n",
        i, x, y, wide, high, failed ? "#333333" : heat_code(part));
    svg += text(x + wide / 2, y + high / 2 + 4, said, "middle", std::min(11.0, wide / 5),
                failed || part < 0.45 || part > 0.93 ? "style=\"fill:white\" pointer-events=\"none\""
                                                     : "pointer-events=\"none\"");
  }
  for (std::size_t i = 0; i < xs.size(); ++i)
    svg += text(left + (double(i) + 0.5) * wide, bottom + 18, xs[i], "middle");
  for (std::size_t i = 0; i < ys.size(); ++i)
    svg += text(left - 8, bottom - (double(i) + 0.5) * high + 4, ys[i], "end");
  for (int decade = 0; decade <= int(decades); ++decade) {
    const double y = bottom - 20 - 22 * decade;
    svg += fmt::format("<rect x=\"{}\" y=\"{}\" width=\"18\" height=\"22\" fill=\"{}\"/>\n", right + 26, y - 15,
                       heat_code(decade / decades));
    svg += text(right + 52, y, fmt::format("{:g} %", least_percent * std::pow(10.0, decade)));
  }
  return svg + "</svg>\n";
}

}  // namespace tetpbd
