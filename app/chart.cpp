#include "app/chart.h"

#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <limits>

#include "app/files.h"
#include "sim/error.h"
#include "sim/solvers/solver.h"

extern char** environ;

namespace tetpbd {

namespace {

constexpr double width = 860, height = 520, left = 86, right = 210, top = 66, bottom = 62;
constexpr double inner_width = width - left - right, inner_height = height - top - bottom;
constexpr double base = top + inner_height, legend_x = left + inner_width + 14;

std::string text(double x, double y, const std::string& what, const char* anchor = "start", double size = 13,
                 const std::string& more = "") {
  std::string escaped;
  for (char c : what)
    escaped += c == '<' ? "&lt;" : c == '>' ? "&gt;" : c == '&' ? "&amp;" : std::string(1, c);
  return fmt::format(
      "<text x=\"{:.1f}\" y=\"{:.1f}\" font-size=\"{}\" text-anchor=\"{}\" fill=\"#222222\" {}>{}</text>\n",
      x, y, size, anchor, more, escaped);
}

std::string line(double x1, double y1, double x2, double y2, const std::string& style) {
  return fmt::format("<path d=\"M{:.1f} {:.1f}L{:.1f} {:.1f}\" {}/>\n", x1, y1, x2, y2, style);
}

std::string box(double x, double y, double w, double h, const std::string& fill) {
  return fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" {}/>\n", x, y, w, h,
                     fill);
}

struct Axis {
  double low = 1, high = 10;
  bool log = false;
  double part(double value) const {
    return log ? std::log(value / low) / std::log(high / low) : (value - low) / (high - low);
  }
  bool shows(double value) const { return std::isfinite(value) && (!log || value > 0); }
};

Axis fit(const std::vector<double>& values, bool log, bool from_zero) {
  Axis axis;
  axis.log = log;
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (double v : values)
    if (axis.shows(v)) low = std::min(low, v), high = std::max(high, v);
  if (!(low <= high)) return axis;
  if (log) {
    axis.low = std::pow(10, std::floor(std::log10(low) + 1e-9));
    axis.high = std::pow(10, std::ceil(std::log10(high) - 1e-9));
    if (axis.low == axis.high) axis.high *= 10;
  } else {
    if (from_zero) low = std::min(low, 0.0), high = std::max(high, 0.0);
    const double pad = high > low ? 0.05 * (high - low) : 1;
    axis.low = low == 0 ? 0 : low - pad;
    axis.high = high == 0 ? 0 : high + pad;
  }
  return axis;
}

std::vector<double> ticks(const Axis& axis) {
  std::vector<double> result;
  if (axis.log) {
    const bool finer = axis.high / axis.low < 1000;
    for (double decade = axis.low; decade <= axis.high * 1.0001; decade *= 10)
      for (double m : {1.0, 2.0, 5.0})
        if (m == 1 || (finer && decade * m <= axis.high * 1.0001)) result.push_back(decade * m);
    return result;
  }
  const double raw = (axis.high - axis.low) / 6, power = std::pow(10, std::floor(std::log10(raw)));
  const double parts = raw / power;
  const double step = power * (parts < 1.5 ? 1 : parts < 3.5 ? 2 : parts < 7.5 ? 5 : 10);
  for (double v = std::ceil(axis.low / step - 1e-9) * step; v <= axis.high + 1e-9 * step; v += step)
    result.push_back(std::abs(v) < 1e-9 * step ? 0 : v);
  return result;
}

std::string number(double value) {
  return std::abs(value) >= 10000 ? fmt::format("{:g}k", value / 1000) : fmt::format("{:g}", value);
}

// Markers differ as well as colours, for print without colour.
std::string marker(std::size_t index, double x, double y, const std::string& colour) {
  static constexpr std::array shapes = {"m-4 0a4 4 0 1 0 8 0a4 4 0 1 0 -8 0", "m-3.7 -3.7h7.4v7.4h-7.4z",
                                        "m0 -5l4.6 8h-9.2z", "m0 -5l5 5l-5 5l-5 -5z"};
  return fmt::format("<path d=\"M{:.1f} {:.1f}{}\" fill=\"{}\"/>\n", x, y, shapes[index % shapes.size()],
                     colour);
}

std::string bars(const Chart& chart, const Axis& y) {
  std::string svg;
  const double group = inner_width / double(chart.groups.size()),
               bar = 0.8 * group / double(chart.series.size());
  for (std::size_t g = 0; g < chart.groups.size(); ++g) {
    const double start = left + group * (double(g) + 0.1);
    svg += text(start + 0.4 * group, base + 20, chart.groups[g], "middle");
    for (std::size_t k = 0; k < chart.series.size(); ++k) {
      const double value = chart.series[k].y[g], x = start + bar * double(k);
      if (!y.shows(value)) continue;
      const double tall = inner_height * std::clamp(y.part(value), 0.0, 1.0);
      svg += box(x + 1, base - tall, bar - 2, tall, fmt::format("fill=\"{}\"", chart.series[k].colour));
      svg += text(x + bar / 2, base - tall - 4,
                  value >= 100 ? fmt::format("{:.0f}", value) : fmt::format("{:.3g}", value), "middle", 9.5);
    }
  }
  return svg;
}

}  // namespace

std::string palette_colour(std::size_t index) {
  // Okabe and Ito: told apart with any colour vision.
  static constexpr std::array colours = {"#0072b2", "#d55e00", "#555555", "#009e73",
                                         "#cc79a7", "#e69f00", "#56b4e9", "#000000"};
  return colours[index % colours.size()];
}

std::string mode_colour(const std::string& mode) {
  for (std::size_t i = 0; i < solver_modes().size(); ++i)
    if (mode == solver_modes()[i].name) return palette_colour(i);
  return "#222222";
}

std::string to_svg(const Chart& chart) {
  std::vector<double> all_x, all_y;
  for (const Series& s : chart.series)
    all_x.insert(all_x.end(), s.x.begin(), s.x.end()), all_y.insert(all_y.end(), s.y.begin(), s.y.end());
  const Axis x = fit(all_x, chart.log_x, false), y = fit(all_y, chart.log_y, true);
  const auto at_x = [&](double v) { return left + inner_width * x.part(v); };
  const auto at_y = [&](double v) { return base - inner_height * y.part(v); };
  const double middle = top + inner_height / 2;
  std::string svg = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0} {1}\" width=\"{0}\" height=\"{1}\" "
      "font-family=\"DejaVu Sans, Helvetica, Arial, sans-serif\">\n",
      width, height);
  svg += box(0, 0, width, height, "fill=\"white\"");
  svg += text(left, 28, chart.title, "start", 17, "font-weight=\"bold\"");
  svg += text(left, 48, chart.subtitle, "start", 12);
  for (double v : ticks(y)) {
    svg += line(left, at_y(v), left + inner_width, at_y(v), "stroke=\"#dddddd\"");
    svg += text(left - 8, at_y(v) + 4, number(v), "end", 12);
  }
  svg +=
      text(22, middle, chart.y_label, "middle", 13, fmt::format("transform=\"rotate(-90 22 {})\"", middle));
  if (chart.groups.empty())
    for (double v : ticks(x)) {
      svg += line(at_x(v), top, at_x(v), base, "stroke=\"#eeeeee\"");
      svg += text(at_x(v), base + 18, number(v), "middle", 12);
    }
  else
    svg += bars(chart, y);
  svg += text(left + inner_width / 2, height - 18, chart.x_label, "middle");
  svg += box(left, top, inner_width, inner_height, "fill=\"none\" stroke=\"#888888\"");
  if (chart.log_y && std::none_of(all_y.begin(), all_y.end(), [](double v) { return v > 0; }))
    svg += text(left + inner_width / 2, middle, "every value is 0", "middle", 15);
  double legend = top + 10;
  for (std::size_t k = 0; k < chart.series.size(); ++k, legend += 20) {
    const Series& s = chart.series[k];
    svg += text(legend_x + 30, legend + 4, s.name, "start", 12);
    if (!chart.groups.empty()) {
      svg += box(legend_x, legend - 5, 14, 10, fmt::format("fill=\"{}\"", s.colour));
      continue;
    }
    std::string path, points;
    for (std::size_t i = 0; i < s.x.size(); ++i) {
      if (!x.shows(s.x[i]) || !y.shows(s.y[i])) continue;
      path += fmt::format("{}{:.1f} {:.1f}", path.empty() ? "M" : "L", at_x(s.x[i]), at_y(s.y[i]));
      if (s.markers) points += marker(k, at_x(s.x[i]), at_y(s.y[i]), s.colour);
    }
    const std::string style = fmt::format("stroke=\"{}\" stroke-width=\"{}\" fill=\"none\"{}", s.colour,
                                          s.dashed ? 1.3 : 1.8, s.dashed ? " stroke-dasharray=\"6 4\"" : "");
    if (s.line && !path.empty()) svg += fmt::format("<path d=\"{}\" {}/>\n", path, style);
    svg += points;
    if (s.line) svg += line(legend_x, legend, legend_x + 24, legend, style);
    if (s.markers) svg += marker(k, legend_x + 12, legend, s.colour);
  }
  // Below and to the left, where a front leaves room; at the left edge there is none.
  for (const Chart::Note& note : chart.notes)
    if (x.shows(note.x) && y.shows(note.y)) {
      const bool at_edge = x.part(note.x) < 0.16;
      svg += text(at_x(note.x) + (at_edge ? 9 : -7), at_y(note.y) + (at_edge ? -6 : 14), note.text,
                  at_edge ? "start" : "end", 10.5);
    }
  return svg + "</svg>\n";
}

void write_chart(const std::filesystem::path& name, const std::string& svg) {
  // Absolute: a folder whose name begins with a dash is no option of rsvg-convert.
  const std::string whole = std::filesystem::absolute(name).string();
  const std::string svg_file = whole + ".svg";
  const PartFile png(whole + ".png");
  write_file(svg_file, svg);
  const char* arguments[] = {"rsvg-convert", "-z", "1.5", "-o", png.part.c_str(), svg_file.c_str(), nullptr};
  pid_t child = 0;
  int status = -1;
  if (posix_spawnp(&child, arguments[0], nullptr, nullptr, const_cast<char* const*>(arguments), environ) == 0)
    while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
    }
  if (status == 0) return png.finish();
  std::fputs(fmt::format("tetpbd: no {}: rsvg-convert did not make it: install librsvg2-bin\n",
                         printable(png.file.string()))
                 .c_str(),
             stderr);
}

}  // namespace tetpbd
