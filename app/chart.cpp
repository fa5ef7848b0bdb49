#include "app/chart.h"

#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <limits>

#include "app/files.h"
#include "sim/solvers/solver.h"
#include "sim/error.h"
#include "sim/files.h"

extern char** environ;

namespace tetpbd {

namespace {

constexpr double width = 860, height = 520, left = 86, right = 210, top = 66, bottom = 62;
constexpr double inner_width = width - left - right, inner_height = height - top - bottom;
constexpr const char* ink = "#222222";

std::string escaped(const std::string& text) {
  std::string result;
  for (char c : text) {
    if (c == '<')
      result += "&lt;";
    else if (c == '>')
      result += "&gt;";
    else if (c == '&')
      result += "&amp;";
    else
      result += c;
  }
  return result;
}

std::string text(double x, double y, const std::string& what, const std::string& anchor = "start",
                 double size = 13, const std::string& more = "") {
  return fmt::format(
      "<text x=\"{:.1f}\" y=\"{:.1f}\" font-size=\"{}\" text-anchor=\"{}\" fill=\"{}\" {}>{}</text>\n", x, y,
      size, anchor, ink, more, escaped(what));
}

std::string line(double x1, double y1, double x2, double y2, const std::string& style) {
  return fmt::format("<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" {}/>\n", x1, y1, x2, y2,
                     style);
}

struct Axis {
  double low = 0, high = 1;
  bool log = false;
  double part(double value) const {
    return log ? (std::log(value) - std::log(low)) / (std::log(high) - std::log(low))
               : (value - low) / (high - low);
  }
  bool shows(double value) const { return std::isfinite(value) && (!log || value > 0); }
};

Axis fit(const std::vector<double>& values, bool log, bool from_zero) {
  Axis axis;
  axis.log = log;
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (double v : values)
    if (axis.shows(v)) low = std::min(low, v), high = std::max(high, v);
  if (!(low <= high)) low = 1, high = 10;
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
    for (double v = axis.low; v <= axis.high * 1.0001; v *= 10) result.push_back(v);
    if (result.size() <= 3) {
      std::vector<double> finer;
      for (double decade : result)
        for (double m : {1.0, 2.0, 5.0})
          if (decade * m <= axis.high * 1.0001) finer.push_back(decade * m);
      return finer;
    }
    return result;
  }
  const double raw = (axis.high - axis.low) / 6, power = std::pow(10, std::floor(std::log10(raw)));
  const double step = raw / power < 1.5   ? power
                      : raw / power < 3.5 ? 2 * power
                      : raw / power < 7.5 ? 5 * power
                                          : 10 * power;
  for (double v = std::ceil(axis.low / step - 1e-9) * step; v <= axis.high + 1e-9 * step; v += step)
    result.push_back(std::abs(v) < 1e-9 * step ? 0 : v);
  return result;
}

std::string number(double value) {
  return std::abs(value) >= 10000 ? fmt::format("{:g}k", value / 1000) : fmt::format("{:g}", value);
}

std::string head(const std::string& title, const std::string& subtitle) {
  std::string svg = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0} {1}\" width=\"{0}\" height=\"{1}\" "
      "font-family=\"DejaVu Sans, Helvetica, Arial, sans-serif\">\n"
      "<rect width=\"{0}\" height=\"{1}\" fill=\"white\"/>\n",
      width, height);
  svg += text(left, 28, title, "start", 17, "font-weight=\"bold\"");
  svg += text(left, 48, subtitle, "start", 12);
  return svg;
}

std::string y_axis(const Axis& axis, const std::string& label) {
  std::string svg;
  for (double v : ticks(axis)) {
    const double y = top + inner_height * (1 - axis.part(v));
    svg += line(left, y, left + inner_width, y, "stroke=\"#dddddd\"");
    svg += text(left - 8, y + 4, number(v), "end", 12);
  }
  const double middle = top + inner_height / 2;
  return svg +
         text(22, middle, label, "middle", 13, fmt::format("transform=\"rotate(-90 22 {:.1f})\"", middle));
}

std::string frame() {
  return fmt::format(
      "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" fill=\"none\" stroke=\"#888888\"/>\n", left, top,
      inner_width, inner_height);
}

// Markers differ as well as colours, for print without colour.
std::string marker(std::size_t index, double x, double y, const std::string& colour) {
  switch (index % 4) {
    case 0:
      return fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"4\" fill=\"{}\"/>\n", x, y, colour);
    case 1:
      return fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"7.4\" height=\"7.4\" fill=\"{}\"/>\n",
                         x - 3.7, y - 3.7, colour);
    case 2:
      return fmt::format("<path d=\"M{:.1f} {:.1f}l4.6 8h-9.2z\" fill=\"{}\"/>\n", x, y - 5, colour);
    default:
      return fmt::format("<path d=\"M{:.1f} {:.1f}l5 5l-5 5l-5 -5z\" fill=\"{}\"/>\n", x, y - 5, colour);
  }
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
  if (mode == "node+handles") return palette_colour(solver_modes().size());
  return mode.starts_with("node+handles") ? "#7a3e9d" : ink;
}

std::string to_svg(const Chart& chart) {
  std::vector<double> all_x, all_y;
  for (const Series& s : chart.series)
    all_x.insert(all_x.end(), s.x.begin(), s.x.end()), all_y.insert(all_y.end(), s.y.begin(), s.y.end());
  const Axis x = fit(all_x, chart.log_x, false), y = fit(all_y, chart.log_y, true);
  const auto at_x = [&](double v) { return left + inner_width * x.part(v); };
  const auto at_y = [&](double v) { return top + inner_height * (1 - y.part(v)); };
  std::string svg = head(chart.title, chart.subtitle) + y_axis(y, chart.y_label);
  for (double v : ticks(x)) {
    svg += line(at_x(v), top, at_x(v), top + inner_height, "stroke=\"#eeeeee\"");
    svg += text(at_x(v), top + inner_height + 18, number(v), "middle", 12);
  }
  svg += text(left + inner_width / 2, height - 18, chart.x_label, "middle");
  svg += frame();
  if (chart.log_y && std::none_of(all_y.begin(), all_y.end(), [](double v) { return v > 0; }))
    svg += text(left + inner_width / 2, top + inner_height / 2, "every value is 0", "middle", 15);
  double legend = top + 10;
  for (std::size_t k = 0; k < chart.series.size(); ++k) {
    const Series& s = chart.series[k];
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
    if (s.line) svg += line(left + inner_width + 14, legend, left + inner_width + 38, legend, style);
    if (s.markers) svg += marker(k, left + inner_width + 26, legend, s.colour);
    svg += text(left + inner_width + 44, legend + 4, s.name, "start", 12);
    legend += 20;
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

std::string to_svg(const BarChart& chart) {
  std::vector<double> all;
  for (const auto& s : chart.series) all.insert(all.end(), s.values.begin(), s.values.end());
  const Axis y = fit(all, chart.log_y, true);
  std::string svg = head(chart.title, chart.subtitle) + y_axis(y, chart.y_label) + frame();
  const double group_width = inner_width / double(std::max<std::size_t>(1, chart.groups.size()));
  const double bar = 0.8 * group_width / double(std::max<std::size_t>(1, chart.series.size()));
  const double base = top + inner_height;
  for (std::size_t g = 0; g < chart.groups.size(); ++g) {
    const double start = left + group_width * (double(g) + 0.1);
    svg += text(start + 0.4 * group_width, base + 20, chart.groups[g], "middle");
    for (std::size_t k = 0; k < chart.series.size(); ++k) {
      const double value = chart.series[k].values[g];
      if (!y.shows(value)) continue;
      const double bar_top = base - inner_height * std::clamp(y.part(value), 0.0, 1.0);
      svg +=
          fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"{}\"/>\n",
                      start + bar * double(k) + 1, bar_top, bar - 2, base - bar_top, chart.series[k].colour);
      svg += text(start + bar * (double(k) + 0.5), bar_top - 4,
                  value >= 100 ? fmt::format("{:.0f}", value) : fmt::format("{:.3g}", value), "middle", 9.5);
    }
  }
  double legend = top + 10;
  for (const auto& s : chart.series) {
    svg += fmt::format("<rect x=\"{}\" y=\"{}\" width=\"14\" height=\"10\" fill=\"{}\"/>\n",
                       left + inner_width + 14, legend - 5, s.colour);
    svg += text(left + inner_width + 34, legend + 4, s.name, "start", 12);
    legend += 20;
  }
  return svg + "</svg>\n";
}

void write_chart(const std::filesystem::path& name, const std::string& svg) {
  // Absolute: a folder whose name begins with a dash is no option of rsvg-convert.
  const std::string whole = std::filesystem::absolute(name).string();
  const std::string svg_file = whole + ".svg", png_file = whole + ".png",
                    part = temporary_name(png_file).string();
  write_file(svg_file, svg);
  const char* arguments[] = {"rsvg-convert", "-z", "1.5", "-o", part.c_str(), svg_file.c_str(), nullptr};
  pid_t child = 0;
  int status = -1;
  if (posix_spawnp(&child, "rsvg-convert", nullptr, nullptr, const_cast<char* const*>(arguments), environ) ==
      0)
    while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
    }
  if (status == 0) return rename_whole(part, png_file);
  std::error_code ignored;
  std::filesystem::remove(part, ignored);
  std::fputs(
      fmt::format("tetpbd: no {}: rsvg-convert did not make it: install librsvg2-bin\n", printable(png_file))
          .c_str(),
      stderr);
}

}  // namespace tetpbd
