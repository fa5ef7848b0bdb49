// What is drawn of a session, where, and from where.
#include <algorithm>
#include <cmath>

#include "app/window/edit_obstacles.h"
#include "render/obstacles.h"

namespace tetpbd {

Viewport tile_in(const Session& s, std::size_t lane, int width, int height) {
  if (s.overlaid) return {0, 0, width, height};
  return tile_of(lane, s.loaded.lanes.size(), width, height);
}

Rect lane_place(const Session& s, std::size_t lane, const Rect& view) {
  const Viewport tile = tile_in(s, lane, int(view.width), int(view.height));
  return {view.x + float(tile.x), view.y + view.height - float(tile.y + tile.height), float(tile.width),
          float(tile.height)};
}

glm::vec2 seen_at(const Session& s, const Rect& place, const glm::dvec3& point) {
  const glm::vec4 seen =
      projection_matrix(s.camera, place.width / place.height) * view_matrix(s.camera) * glm::vec4(glm::vec3(point), 1);
  return {place.x + place.width * (0.5f + 0.5f * seen.x / seen.w),
          place.y + place.height * (0.5f - 0.5f * seen.y / seen.w)};
}

void move_cut(Session& s, double by) { s.view.cut = std::clamp(s.view.cut + by, 0.0, 1.0); }

void next_cut(Session& s) {
  ViewOptions& view = s.view;
  view.cut_axis = view.is_cut() ? (view.cut_axis + 1) % 5 : 0;
  view.cut = view.cut_axis < 4 ? 0.5 : 1;
  if (view.cut_axis == 4) view.cut_axis = 0;
  view.cut_normal = glm::normalize(eye(s.camera) - s.camera.target);
  s.log("cut {:.4f} along {}", view.cut, cut_names[std::size_t(view.cut_axis)]);
}

Frame shown_frame(const Session& s, std::size_t lane) {
  Frame frame = make_frame(s.loaded.lanes[lane], s.camera, s.view, {});
  frame.viewport = {};
  frame.options.follow = false;
  return frame;
}

void draw_lanes(Session& s, const Target& target) {
  hold_vertices(s);
  auto& lanes = s.loaded.lanes;
  const bool several = lanes.size() > 1;
  const std::size_t right = best_lane(lanes);
  // Whose values come back: a range is to fit the lane that is farthest off, too.
  const auto off = [](const Lane& l) { return l.far().value_or(0.0f); };
  const bool farthest = s.fit_range && s.view.colour == Colour::motion;
  const std::size_t valued =
      farthest ? std::size_t(std::ranges::max_element(lanes, {}, off) - lanes.begin()) : s.loaded.chosen;
  const bool flattest = s.view.flattest || std::exchange(s.ui.at_flattest, false);
  for (std::size_t i = 0; i < lanes.size(); ++i) {
    Frame frame = make_frame(lanes[i], s.camera, s.view, target);
    frame.viewport = tile_in(s, i, target.width, target.height);
    // The hand's are larger than those of the scene.
    for (const std::uint32_t v : s.timeline.touched)
      if (is_pinned(lanes[i].sim, v) && !(s.hold && s.hold->has(v))) frame.grabbed.push_back(v);
    if (s.hold) {
      frame.grabbed.push_back(s.hold->caught());
      std::erase_if(frame.pinned, [&](std::uint32_t v) { return s.hold->has(v); });
    }
    for (auto* marked : {&frame.pinned, &frame.grabbed})
      std::erase_if(*marked, [&](std::uint32_t v) { return is_hidden(s.loaded.renderer, v); });
    frame.chosen_obstacle = s.obstacle;
    frame.options.follow = s.view.follow && i == s.loaded.chosen;
    frame.options.worst = (s.view.worst || s.fit_range) && i == valued;
    if (s.view.worst && i == s.loaded.chosen)
      for (const auto& [vertex, value] : s.worst) frame.worst.push_back(vertex);
    if (flattest) frame.tet = std::uint32_t(s.loaded.flattest.tet);
    if (s.view.colour == Colour::motion && s.loaded.comparable) frame.values = lanes[i].apart.id();
    if (s.view.colour == Colour::patch) frame.values = patch_numbers(lanes[i]);
    if ((s.view.colour == Colour::motion || s.view.colour == Colour::patch) && !frame.values)
      frame.options.colour = Colour::plain;
    if (several) {
      frame.options.body_colour = lane_colour(i);
      frame.options.legend = s.view.legend && i + 1 == lanes.size();
      frame.caption = describe(lanes[i], !s.loaded.comparable);
      if (const auto far = lanes[i].far(); far && !lanes[i].stopped())
        frame.caption += i == right && !right_now(s) ? ": reference"
                         : *far < 1e-3f              ? ": same"
                                                     : fmt::format(": {:.2g} % error", *far);
    }
    if (s.overlaid) frame.caption.clear();
    if (s.overlaid && i > 0) frame.over = true, frame.options.shadow = false;
    draw(s.loaded.renderer, frame);
    if (!several || s.overlaid || !s.ghost || i == right) continue;
    frame.positions = lanes[right].positions().id(), frame.velocities = lanes[right].velocities().id();
    frame.over = true, frame.opacity = 0.3f, frame.caption.clear();
    frame.pinned.clear(), frame.grabbed.clear(), frame.worst.clear(), frame.tet.reset();
    frame.options.arrows = frame.options.contacts = false;
    frame.options.colour = Colour::plain, frame.options.body_colour = glm::vec3(0.25f);
    frame.options.worst = frame.options.shadow = frame.options.follow = frame.options.legend = false;
    draw(s.loaded.renderer, frame);
  }
}

// Waits for the GPU, once for the keystroke: no kernel and no buffer stand by for so rare a question.
void frame_body(Session& s) {
  const Lane& lane = s.loaded.lane();
  const Bounds bodies = bounds(make_state(lane.positions().read_all<Position>(), {}).positions);
  const Bounds box = with_obstacles(bodies, *s.loaded.model, lane.time(), bodies.size());
  frame_box(s.camera, glm::vec3(box.low), glm::vec3(box.high), s.aspect, 1.35f);
  s.beside = glm::vec3(0);
  note(s, action::SetCamera{s.camera});
  s.log("frame {:.3f} {:.3f} {:.3f}", s.camera.target.x, s.camera.target.y, s.camera.target.z);
}

void keep_above_ground(Session& s) {
  const Settings& world = s.loaded.sim().settings;
  if (!world.ground || s.camera.target.y < float(world.ground_height)) return;
  const float least = (float(world.ground_height) - s.camera.target.y) / s.camera.distance + 0.01f;
  s.camera.elevation = std::max(s.camera.elevation, glm::degrees(std::asin(std::clamp(least, -1.0f, 1.0f))));
}

void hide_body(Session& s, std::size_t body, bool hidden) {
  s.loaded.hidden.resize(s.loaded.model->bodies.size());
  if (s.loaded.hidden[body] == hidden) return;
  s.loaded.hidden[body] = hidden;
  hide_bodies(s.loaded.renderer, s.loaded.hidden);
  s.loaded.probe.reading.reset();
  s.worst.clear();
  s.log("{} {}", hidden ? "hidden" : "shown", s.loaded.model->bodies[body].name);
}

void hide_or_show(Session& s) {
  if (const auto& reading = s.loaded.probe.reading)
    return hide_body(s, body_at(*s.loaded.model, reading->vertex).number, true);
  for (std::size_t b = 0; b < s.loaded.hidden.size(); ++b) hide_body(s, b, false);
}

bool follow_bodies(Session& s, double elapsed) {
  if (!s.view.follow) return false;
  attempt(s, [&] {
    if (const auto now = poll_centre(s.loaded.renderer)) s.centre = now;
  });
  // While the mouse pulls a vertex it aims by the camera, which therefore keeps still.
  if (!s.centre || s.grab || s.moving_obstacle) return false;
  const glm::vec3 goal = *s.centre + s.beside;
  follow(s.camera, goal, float(elapsed));
  return glm::distance(s.camera.target, goal) > 1e-3f * s.camera.distance;
}

}  // namespace tetpbd
