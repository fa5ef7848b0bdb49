// The plots below the view: quantities of all lanes over time, looked at closely, copied and saved.
#include <imgui.h>

#include <algorithm>
#include <cmath>

#include "app/files.h"
#include "app/lab/run.h"
#include "app/window/ui.h"
#include "app/window/widgets.h"
#include "sim/model/material.h"

namespace tetpbd {

namespace {

/// Of a lane, points of a plot: time or cost, value.
struct Curve {
  std::size_t lane;
  std::vector<glm::dvec2> points;
};

std::vector<Curve> curves_of(const Session& s, const PlotRow& row) {
  std::vector<Curve> curves;
  for (std::size_t i = 0; i < s.loaded.lanes.size(); ++i) {
    const Lane& lane = s.loaded.lanes[i];
    const History& history = row.of ? lane.*row.of : s.frames_per_second;
    if (history.values.empty() || (!row.of && i > 0)) continue;
    Curve curve{i, {}};
    const auto& costs = lane.step_ms.values;
    if (row.over_cost && costs.empty()) continue;
    // Of late: settings change.
    const double cost =
        row.over_cost ? median({costs.end() - std::min<std::ptrdiff_t>(240, std::ssize(costs)), costs.end()}) : 0;
    for (std::size_t k = 0; k < history.values.size(); ++k)
      curve.points.emplace_back(row.over_cost ? cost : history.times[k], double(history.values[k]));
    curves.push_back(std::move(curve));
  }
  return curves;
}

// What lanes have in common goes without saying.
std::string lane_name(const Session& s, const Curve& curve) {
  return describe(s.loaded.lanes[curve.lane], !s.loaded.comparable);
}

std::string title_of(const Session& s, const PlotRow& row) {
  const bool right = right_now(s);
  const std::string from = right ? "distance from the reference motion" : "distance from the finest lane";
  const Settings& own = s.loaded.sim().settings;
  if (row.of == &Lane::energy && !any_material(own, has_energy) && !all_materials(own, hard))
    return "energy but for elastic";
  return row.of != &Lane::distance ? row.title : row.over_cost ? "distance over time per step" : from;
}

constexpr double least_shown = 1e-4;  // where a scale is of powers of ten
double scaled(double v, bool powers) { return powers ? std::log10(std::max(v, least_shown)) : v; }

/// What of the axes is seen, in powers of ten where they are.
struct Scales {
  bool powers_x, powers_y;
  double left, right, low, high;
  ImVec2 corner, size;
  ImVec2 at(const glm::dvec2& p) const {
    return ImVec2(corner.x + size.x * float((scaled(p.x, powers_x) - left) / (right - left)),
                  corner.y + size.y * float(1 - (scaled(p.y, powers_y) - low) / (high - low)));
  }
};

// Wheel and drag on a plot that is all of `from` .. `to`.
void look_closer(Session& s, std::size_t slot, double from, double to, const ImVec2& corner, float width) {
  PlotView& view = s.ui.plot_views[slot];
  const ImGuiIO& io = ImGui::GetIO();
  const bool was = view.zoomed;
  if (!view.zoomed) view.low = from, view.high = to;
  const double before = view.low, span = view.high - view.low;
  if (ImGui::IsItemHovered() && io.MouseWheel != 0) {
    const double at = view.low + span * double((io.MousePos.x - corner.x) / width);
    const double factor = std::pow(0.8, double(io.MouseWheel));
    view.low = at - (at - view.low) * factor, view.high = at + (view.high - at) * factor;
    view.zoomed = view.high - view.low < to - from;
  }
  if (ImGui::IsItemActive() && view.zoomed) {
    const double by = -span * double(io.MouseDelta.x / width);
    view.low += by, view.high += by;
  }
  if (ImGui::IsItemHovered() && ImGui::IsMouseDoubleClicked(0)) view.zoomed = false;
  if (was != view.zoomed || (view.zoomed && view.low != before))
    s.log("plot {} {}", slot + 1, view.zoomed ? fmt::format("{:.4g} .. {:.4g}", view.low, view.high) : "whole");
}

// No more points than pixels have room for: of each column the first, the extremes and the last.
std::vector<ImVec2> thinned(const Scales& axes, const std::vector<glm::dvec2>& points) {
  std::vector<ImVec2> seen, column;
  const auto put = [&] {
    const auto [high, low] = std::ranges::minmax_element(column, {}, &ImVec2::y);
    for (const ImVec2* p : {&column.front(), &*std::min(high, low), &*std::max(high, low), &column.back()})
      if (seen.empty() || seen.back().x != p->x || seen.back().y != p->y) seen.push_back(*p);
    column.clear();
  };
  for (const glm::dvec2& point : points) {
    const ImVec2 p = axes.at(point);
    if (!column.empty() && std::floor(column.front().x) != std::floor(p.x)) put();
    column.push_back(p);
  }
  if (!column.empty()) put();
  return seen;
}

std::string value_text(const Session& s, const PlotRow& row, const Curve& curve, const glm::dvec2& point) {
  std::string text = s.loaded.lanes.size() > 1 && row.of ? lane_name(s, curve) + ": " : "";
  text += fmt::format("{:.4g} {}", point.y, row.unit);
  return row.over_cost ? text + fmt::format(" in {:.3g} ms", point.x) : text;
}

void draw_curves(Session& s, const PlotRow& row, std::size_t slot, const ImVec2& size) {
  const std::vector<Curve> curves = curves_of(s, row);
  const ImVec2 corner = ImGui::GetCursorScreenPos();
  ImGui::InvisibleButton("plot", size);
  mark(s, fmt::format("plot {}", slot + 1));
  ImDrawList& draw = *ImGui::GetWindowDrawList();
  const ImVec2 end(corner.x + size.x, corner.y + size.y);
  draw.AddRectFilled(corner, end, ImGui::GetColorU32(ImGuiCol_FrameBg));
  if (curves.empty()) return;
  Scales axes{row.over_cost, row.powers && (s.loaded.lanes.size() > 1 || row.of == &Lane::distance),
              1e300,         -1e300,
              1e300,         -1e300,
              corner,        size};
  for (const Curve& curve : curves)
    for (const glm::dvec2& p : curve.points)
      axes.left = std::min(axes.left, scaled(p.x, axes.powers_x)),
      axes.right = std::max(axes.right, scaled(p.x, axes.powers_x));
  if (axes.powers_x) axes.left = std::floor(axes.left), axes.right = std::ceil(axes.right);
  if (!(axes.right > axes.left)) axes.right = axes.left + 1;
  look_closer(s, slot, axes.left, axes.right, corner, size.x);
  if (const PlotView& view = s.ui.plot_views[slot]; view.zoomed) axes.left = view.low, axes.right = view.high;
  std::vector<double> seen;
  for (const Curve& curve : curves)
    for (const glm::dvec2& p : curve.points)
      if (const double x = scaled(p.x, axes.powers_x); x >= axes.left && x <= axes.right)
        seen.push_back(scaled(p.y, axes.powers_y));
  if (seen.empty()) seen = {0, 1};
  axes.low = std::ranges::min(seen), axes.high = std::ranges::max(seen);
  // A step that compiles a shader is a hundred times as long as the others; a spike flattens what is of interest.
  const double usual = percentile(seen, 0.98), highest = axes.high;
  if (const double least = percentile(seen, 0.02); !axes.powers_y && least < 0)
    axes.low = std::max(axes.low, 3 * least);
  if (const double most = axes.powers_y ? usual + 0.3 : 3 * usual; usual > axes.low)
    axes.high = std::min(highest, most);
  if (axes.powers_y) {
    axes.low = std::floor(axes.low), axes.high = std::max(std::ceil(axes.high), axes.low + 1);
  } else {  // from 0 on, so that a plot does not magnify what hardly changes
    axes.low = std::min(axes.low, 0.0), axes.high = std::max(axes.high, axes.low + 1e-3);
  }
  const ImU32 faint = ImGui::GetColorU32(ImGuiCol_Text, 0.15f), ink = ImGui::GetColorU32(ImGuiCol_Text, 0.6f);
  draw.PushClipRect(corner, end, true);
  for (double decade = std::ceil(axes.low); axes.powers_y && decade <= axes.high; ++decade) {
    const float y = corner.y + size.y * float(1 - (decade - axes.low) / (axes.high - axes.low));
    draw.AddLine(ImVec2(corner.x, y), ImVec2(end.x, y), faint);
  }
  if (const double now = s.loaded.lane().time(); row.of && !row.over_cost && now < axes.right) {  // back in time
    const float x = corner.x + size.x * float((now - axes.left) / (axes.right - axes.left));
    draw.AddLine(ImVec2(x, corner.y), ImVec2(x, end.y), ImGui::GetColorU32(ImGuiCol_Text, 0.4f));
  }
  const bool hovered = ImGui::IsItemHovered();
  const float mouse = ImGui::GetIO().MousePos.x;
  const double there = axes.left + (axes.right - axes.left) * double((mouse - corner.x) / size.x);
  std::string values = row.over_cost ? "" : fmt::format("{:.4g} s", there);
  if (hovered && !row.over_cost) draw.AddLine(ImVec2(mouse, corner.y), ImVec2(mouse, end.y), faint, 1.5f);
  for (const Curve& curve : curves) {
    const glm::vec3 c = lane_colour(curve.lane) * (s.ui.kept.dark ? 1.2f : 0.8f);
    const ImU32 colour = s.loaded.lanes.size() > 1 ? ImGui::GetColorU32(ImVec4(c.x, c.y, c.z, 1))
                                                   : ImGui::GetColorU32(ImGuiCol_Text, 0.85f);
    const auto line = thinned(axes, curve.points);
    draw.AddPolyline(line.data(), int(line.size()), colour, 0, (s.loaded.lanes.size() > 1 ? 1.6f : 1.2f) * s.ui.scale);
    glm::dvec2 marked = curve.points.back();
    if (hovered && !row.over_cost)
      marked = *std::ranges::min_element(curve.points, {}, [&](const glm::dvec2& p) { return std::abs(p.x - there); });
    draw.AddCircleFilled(axes.at(marked), (hovered || s.loaded.lanes.size() > 1 ? 3.5f : 2.0f) * s.ui.scale, colour);
    values += fmt::format("{}{}", values.empty() ? "" : "\n", value_text(s, row, curve, marked));
  }
  const auto label = [&](bool at_right, bool at_top, const std::string& text) {
    const ImVec2 box = ImGui::CalcTextSize(text.c_str());
    const ImVec2 low(at_right ? end.x - box.x - 3 : corner.x + 3, at_top ? corner.y : end.y - box.y);
    draw.AddRectFilled(low, ImVec2(low.x + box.x, low.y + box.y), ImGui::GetColorU32(ImGuiCol_FrameBg, 0.75f));
    draw.AddText(low, ink, text.c_str());
  };
  const auto number = [](double v, bool powers) { return fmt::format("{:.3g}", powers ? std::pow(10.0, v) : v); };
  const std::string peak = highest > axes.high ? ", peak " + number(highest, axes.powers_y) : "";
  label(false, true, number(axes.high, axes.powers_y) + " " + row.unit + peak);
  if (curves.size() == 1) label(true, true, value_text(s, row, curves[0], curves[0].points.back()));
  label(false, false, number(axes.low, axes.powers_y) + " " + row.unit);
  label(true, false,
        number(axes.left, axes.powers_x) + " .. " + number(axes.right, axes.powers_x) + (row.over_cost ? " ms" : " s"));
  draw.PopClipRect();
  if (hovered) ImGui::SetTooltip("%s", values.c_str());
}

void draw_slot(Session& s, std::size_t slot, float x, float width) {
  std::size_t& chosen = s.ui.plot_choice[s.loaded.lanes.size() > 1][slot];
  ImGui::SetCursorPos(ImVec2(x, ImGui::GetStyle().WindowPadding.y));
  ImGui::PushID(int(slot));
  ImGui::BeginGroup();
  const ImGuiStyle& style = ImGui::GetStyle();
  const float buttons = 2 * (ImGui::CalcTextSize("CSV").x + 2 * style.FramePadding.x + style.ItemSpacing.x);
  const std::string title = title_of(s, plot_rows()[chosen]);
  ImGui::SetNextItemWidth(width - buttons);
  const std::string name = fmt::format("plotted {}", slot + 1);
  if (ImGui::BeginCombo("##plotted", title.c_str(), ImGuiComboFlags_HeightLarge)) {
    for (std::size_t i = 0; i < plot_rows().size(); ++i) {
      const std::string choice = title_of(s, plot_rows()[i]);
      if (ImGui::Selectable(choice.c_str(), i == chosen)) {
        chosen = i;
        s.ui.plot_views[slot] = {};
        s.log("{} {}", name, choice);
      }
      mark(s, name + "=" + choice);
    }
    ImGui::EndCombo();
  }
  describe_item(s, name,
                "what is plotted, of all lanes; the wheel on a plot zooms, a drag scrolls, a double click shows all");
  const PlotRow& row = plot_rows()[chosen];
  ImGui::SameLine();
  if (button(s, "CSV", fmt::format("csv {}", slot + 1).c_str(), "copies all values as CSV")) {
    const std::string text = plot_csv(s, row);
    ImGui::SetClipboardText(text.c_str());
    say(s, fmt::format("copied {} rows", std::ranges::count(text, '\n') - 1));
  }
  ImGui::SameLine();
  if (button(s, "SVG", fmt::format("svg {}", slot + 1).c_str(), "saves the plot into the current folder"))
    attempt(s, [&] {
      const std::string file = free_name("plot", "svg");
      write_file(file, to_svg(plot_chart(s, row)));
      say(s, "saved " + file);
    });
  draw_curves(s, row, slot, ImVec2(width, std::max(ImGui::GetContentRegionAvail().y, 1.0f)));
  ImGui::EndGroup();
  ImGui::PopID();
}

}  // namespace

const std::vector<PlotRow>& plot_rows() {
  static const std::vector<PlotRow> rows = {
      {"frames per second", "fps", nullptr},      {"time per step", "ms", &Lane::step_ms, true},
      {"volume error", "%", &Lane::volume_error}, {"energy", "J", &Lane::energy},
      {"distance", "%", &Lane::distance, true},   {"distance", "%", &Lane::distance, true, true},
      {"depth of contacts", "%", &Lane::depth},   {"energy from nothing", "%", &Lane::created}};
  return rows;
}

std::string plot_csv(const Session& s, const PlotRow& row) {
  std::string text =
      fmt::format("lane,{},{} [{}]\n", row.over_cost ? "time per step [ms]" : "time [s]", title_of(s, row), row.unit);
  for (const Curve& curve : curves_of(s, row)) {
    // A lane's words have commas.
    const std::string name = row.of ? lane_name(s, curve) : "window";
    for (const glm::dvec2& p : curve.points) text += fmt::format("\"{}\",{:.9g},{:.7g}\n", name, p.x, p.y);
  }
  return text;
}

Chart plot_chart(const Session& s, const PlotRow& row) {
  Chart chart{.title = s.loaded.scene.name + ": " + title_of(s, row),
              .subtitle = fmt::format("{} tets, {} steps to {:g} s", s.loaded.sim().model->rest.tets.size(),
                                      s.loaded.lane().steps(), s.loaded.lane().time()),
              .x_label = row.over_cost ? "time per step, ms" : "time, s",
              .y_label = fmt::format("{}, {}", title_of(s, row), row.unit)};
  chart.log_x = row.over_cost;
  chart.log_y = row.powers;
  for (Curve& curve : curves_of(s, row)) {
    Series series{row.of ? lane_name(s, curve) : "window", palette_colour(curve.lane),
                  row.over_cost ? Series::markers : Series::line};
    series.points = row.over_cost ? std::vector{curve.points.back()} : std::move(curve.points);
    chart.series.push_back(std::move(series));
  }
  return chart;
}

void draw_plots(Session& s, const Rect& place) {
  begin_part("plots", place);
  // No more than have room for their titles.
  const float pad = ImGui::GetStyle().WindowPadding.x, room = place.width / (17 * ImGui::GetFontSize());
  const auto count = std::clamp(std::size_t(room), std::size_t(1), std::size_t(3));
  const float width = (place.width - float(count + 1) * pad) / float(count);
  for (std::size_t slot = 0; slot < count; ++slot) draw_slot(s, slot, pad + float(slot) * (pad + width), width);
  ImGui::End();
}

}  // namespace tetpbd
