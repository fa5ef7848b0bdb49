// How bodies look, in the panel.
#include <imgui.h>

#include <algorithm>
#include <bit>
#include <cstdlib>
#include <tuple>

#include "app/window/ui.h"
#include "app/window/widgets.h"

namespace tetpbd {

namespace {

void draw_colour_range(Session& s) {
  if (s.view.colour == Colour::plain) {
    const bool unusual = s.view.body_colour != s.first_view.body_colour;
    ImGui::ColorEdit3(begin_row(s, "body colour", unusual).c_str(), &s.view.body_colour.x,
                      ImGuiColorEditFlags_NoInputs | ImGuiColorEditFlags_NoOptions);
    if (end_row(s, "body colour", "of the first body; others are turned in hue", unusual ? "clay" : ""))
      s.view.body_colour = s.first_view.body_colour;
    return;
  }
  if (s.view.colour == Colour::patch) return;
  ColourRange& range = s.view.range();
  const ColourScale& scale = s.view.scale();
  double high = range.high * scale.factor;
  const double usual = s.first_view.ranges[std::size_t(s.view.colour)].high * scale.factor;
  const std::string unit = scale.factor == 100 ? "%%" : scale.unit;
  if (slider(s, "colour range", high, usual, 1e-4 * scale.most * scale.factor, scale.most * scale.factor,
             ((scale.is_signed ? "+/- %.3g " : "0 .. %.3g ") + unit).c_str(),
             "the value at the end of the colour scale: lower it to see small differences", true))
    range = {scale.is_signed ? -high / scale.factor : 0, high / scale.factor}, s.view.hold_range = true;
  check_box(s, "hold range", s.view.hold_range, "keeps the scale as it is; else it follows the values of now",
            s.first_view.hold_range);
  ImGui::SameLine(label_width());
  check_box(s, "mark worst", s.view.worst, "rings around the vertices with the largest values, inside bodies too\nW",
            s.first_view.worst);
  if (!s.view.worst) return;
  for (const auto& [vertex, value] : s.worst)
    ImGui::TextDisabled("%s",
                        fmt::format(fmt::runtime(scale.is_signed ? "vertex {}: {:+.3g} {}" : "vertex {}: {:.3g} {}"),
                                    s.loaded.sim().model->original[vertex], double(value) * scale.factor, scale.unit)
                            .c_str());
}

// Of the bodies at rest; also while the cursor is on it.
void draw_flattest(Session& s) {
  const Model& model = *s.loaded.model;
  const FlattestTet& flattest = s.loaded.flattest;
  if (model.rest.tets.empty()) return;
  const Body& body = *(std::ranges::upper_bound(model.bodies, flattest.tet, {}, &Body::first_tet) - 1);
  check_box(s, "flattest tet", s.view.flattest,
            fmt::format("shows its edges through the bodies: tet {} of {}, {:.2g} of an edge high, which limits the "
                        "steps of mode explicit",
                        flattest.tet - body.first_tet, body.name, flattest.quality),
            s.first_view.flattest);
  s.ui.at_flattest = ImGui::IsItemHovered();
  ImGui::SameLine(label_width());
  ImGui::TextDisabled("%s", fmt::format("{:.3g} m high, {}", flattest.altitude, body.name).c_str());
}

}  // namespace

void draw_view(Session& s) {
  ViewOptions& view = s.view;
  const ViewOptions& first = s.first_view;
  enum_combo(s, "look", look_names, view.look, first.look,
             "surface; with its edges; the tetrahedra, to see inside; the constraints between vertices\n1 2 3 4");
  Words colours;
  for (std::size_t i = 0; i < colour_names.size(); ++i)
    if (has_colour(s, Colour(i)) || view.colour == Colour(i)) colours.push_back(colour_names[i]);
  if (const auto name = combo(s, "colour", colour_names[std::size_t(view.colour)], colours,
                              "what the surface shows: nothing, or by how much volume, lengths of edges, speed, "
                              "elastic energy or the motion are off; patch: what is solved together\nC",
                              colour_names[std::size_t(first.colour)]))
    choose_colour(s, Colour(std::ranges::find(colour_names, *name) - colour_names.begin()));
  draw_colour_range(s);
  draw_flattest(s);
  if (view.look == Look::tets) {
    slider(s, "shrink", view.shrink, first.shrink, 0, 1, "%.2f of its size",
           "each tetrahedron, towards its centre: gaps show the inside");
    slider(s, "explode", view.explode, first.explode, 0, 3, "%.2f of the way",
           "tetrahedra away from the bodies' centre");
  }
  slider(s, "cut", view.cut, first.cut, 0, 1, view.is_cut() ? "%.2f of the body" : "off",
         "what is below this part of the bodies at rest is shown; 1: all\nX; Alt+drag, Alt+wheel on the view");
  if (view.is_cut()) {
    const int before = view.cut_axis;
    enum_combo(s, "cut along", cut_names, view.cut_axis, first.cut_axis,
               "the direction in which a cut goes; the view: from the eye of now");
    if (view.cut_axis != before) view.cut_normal = glm::normalize(eye(s.camera) - s.camera.target);
  }
  const std::tuple<const char*, const char*, bool&, bool> switches[] = {
      {"follow", "the camera goes where the bodies go\nL", view.follow, first.follow},
      {"probe", "the cursor at rest on a body says what is there", s.probing, true},
      {"contacts",
       "dots where vertices touch the ground, walls or obstacles, arrows where they are in other bodies: "
       "red is a thousandth of the size",
       view.contacts, first.contacts},
      {"arrows", "velocities of some of the vertices", view.arrows, first.arrows},
      {"shadow", "of the bodies, on the ground and on each other", view.shadow, first.shadow},
      {"smooth normals", "round shading; without, each triangle is flat\nN", view.smooth_normals, first.smooth_normals},
      {"grid", "lines on the ground and on walls\nG", view.grid, first.grid},
      {"sky and ground", "also walls; without: one colour", view.backdrop, first.backdrop},
      {"legend", "the colour scale, with every colour but plain", view.legend, first.legend},
      {"vsync", "draw as often as the display shows; without, as often as can be: to measure", s.vsync, true},
      {"as fast as possible", "steps as often as the machine can, instead of in real time", s.clock.fast, false}};
  if (view.arrows)
    slider(s, "arrow length", view.arrow_seconds, first.arrow_seconds, 1e-3, 1, "%.3g s",
           "the time a vertex would take along its arrow", true);
  const bool shadow = view.shadow;
  bool unusual = s.samples != s.first_samples || s.grab_radius != usual_grab_radius;
  for (const auto& [name, help, value, usual] : switches) unusual |= value != usual;
  if (!more(s, "View", unusual)) return;
  for (int i = 0; const auto& [name, help, value, usual] : switches) {
    if (i++ % 2) ImGui::SameLine(label_width());
    check_box(s, name, value, help, usual);
  }
  if (view.shadow != shadow) s.ui.kept.shadow = view.shadow;
  const auto doublings = [](int samples) { return int(std::bit_width(unsigned(samples) / 2)); };
  int now = doublings(s.samples);
  enum_combo(s, "MSAA", std::array{"none", "2x", "4x", "8x"}, now, doublings(s.first_samples),
             "samples of a pixel: smoother edges, and more work for the GPU");
  if (const int wanted = now ? 1 << now : 0; wanted != s.samples) s.ui.kept.samples = s.samples = wanted;
  slider(s, "grab radius", s.grab_radius, usual_grab_radius, 0, 0.3, "%.2f of the size",
         "how much of a body the mouse takes hold of; 0: a single vertex, which can draw out a spike");
  Preferences& kept = s.ui.kept;
  enum_combo(s, "theme", std::array{"light", "dark"}, kept.dark, false, "colours of the panels; it is kept");
  const Words sizes{"75 %", "100 %", "125 %", "150 %", "200 %", "300 %"};
  if (const auto size = combo(s, "text size", fmt::format("{:.0f} %", 100 * kept.text), sizes,
                              "of all text and widgets, on top of the display's own scale; it is kept", "100 %"))
    kept.text = std::atof(size->c_str()) / 100;
}

}  // namespace tetpbd
