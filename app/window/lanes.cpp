#include "app/window/lanes.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <string_view>

#include "app/lab/auto_solver.h"
#include "app/lab/vary.h"
#include "sim/error.h"
#include "sim/model/did_you_mean.h"
#include "sim/model/material.h"

namespace tetpbd {

namespace {

// Steps between two comparisons: reading a state back takes some 0.1 ms per thousand vertices.
long compared_every(const Model& model) { return std::max(4l, long(model.positions.size() / 1000)); }

// How far its iterations go, about.
double effort(const Lane& lane) {
  const Settings& s = lane.sim.settings;
  return solver_mode(s).leapfrog ? 1e9 / s.stability : double(lane.plan().iterations) * lane.plan().substeps;
}

GLuint patch_words(const Sim& sim) {
  for (const auto& [binding, buffer] : sim.solver.bindings)
    if (binding == "Patches" && sim.solver.vertex_patches > 0) return buffer;
  return 0;
}

}  // namespace

void keep_shown(Lane& lane, const ViewOptions& view) {
  const auto copy = [](const Buffer& from, Buffer& to) {
    if (to.bytes() != from.bytes()) to = Buffer("shown " + from.label(), from.bytes());
    from.copy_to(to, 0, 0, from.bytes());
  };
  const Sim& sim = lane.sim;
  copy(sim.positions, lane.shown_positions), copy(sim.velocities, lane.shown_velocities);
  lane.shown = {make_frame(sim, {}, view, {}), sim.steps, simulated_time(sim), sim.plan, sim.adaptive, sim.check.found};
  lane.shown->frame.positions = lane.shown_positions.id(), lane.shown->frame.velocities = lane.shown_velocities.id();
}

Frame make_frame(const Lane& lane, const Camera& camera, const ViewOptions& view, const Target& target) {
  if (!lane.shown) return make_frame(lane.sim, camera, view, target);
  Frame frame = lane.shown->frame;
  frame.camera = camera, frame.options = view;
  frame.viewport = {0, 0, target.width, target.height};
  frame.target = target.framebuffer.id();
  return frame;
}

std::string describe(const Lane& lane, bool material) {
  const Settings& s = lane.sim.settings;
  std::string text = s.mode;
  const auto add = [&](int count, const char* what) {
    if (count != 1) text += fmt::format(", {} {}s", count, what);
  };
  add(lane.plan().substeps, "substep");
  add(lane.plan().iterations, "iteration");
  if (material && s.material != "none" && !has_own_materials(s))
    text += fmt::format(", {} {:.3g} Pa", s.material, s.young_modulus);
  if (solver_mode(s).smoothed && any_material(s, smoothed)) text += ", smoothed";
  if (lane.stopped()) text += fmt::format(": not finite from step {} on", lane.found()->step);
  return text;
}

std::optional<float> History::at(double time) const {
  const auto after = std::ranges::upper_bound(times, time);
  return after == times.begin() ? std::nullopt : std::optional(values[std::size_t(after - times.begin()) - 1]);
}

void History::add(double value, double time) {
  if (!times.empty() && times.back() > time) {
    const auto kept = std::size_t(std::ranges::upper_bound(times, time) - times.begin());
    values.resize(kept), times.resize(kept);
    added = kept ? long(kept - 1) * every + 1 : 0;
  }
  if (!values.empty() && (added - 1) % every != 0) values.pop_back(), times.pop_back();  // stood for the newest alone
  values.push_back(float(value)), times.push_back(time);
  ++added;
  if (values.size() <= most) return;
  for (std::size_t i = 0; 2 * i < values.size(); ++i) values[i] = values[2 * i], times[i] = times[2 * i];
  values.resize((values.size() + 1) / 2), times.resize(values.size());
  every *= 2;
}

std::uint64_t motion_key(const Lane& lane) { return scene_key(*lane.sim.model, lane.sim.settings); }

bool has_patches(const Lane& lane) { return patch_words(lane.sim) != 0; }

GLuint patch_numbers(Lane& lane) {
  const GLuint words = patch_words(lane.sim);
  if (!words || lane.patches) return lane.patches.id();
  const auto& present = lane.sim.system.present;
  const std::size_t patches = lane.sim.solver.vertex_patches,
                    each = 4 + 2 * std::size_t(std::ranges::count(present, true));
  std::vector<std::uint32_t> chunks(patches * each);
  read_buffer(words, 0, chunks.size() * 4, chunks.data());
  std::vector<float> numbers(lane.sim.model->positions.size());
  for (std::size_t p = 0; p < patches; ++p)  // patches.h: how many are owned, the first of them
    for (std::uint32_t k = 0; k < chunks[p * each + 1]; ++k) numbers.at(chunks[p * each + 2] + k) = float(p);
  lane.patches = Buffer("vertex values, patch", numbers);
  return lane.patches.id();
}

glm::vec3 lane_colour(std::size_t lane) {
  // Clay, and three of like lightness that also those tell apart who see few hues.
  constexpr std::array<glm::vec3, most_lanes> colours{
      {{0.74f, 0.50f, 0.41f}, {0.25f, 0.55f, 0.75f}, {0.45f, 0.62f, 0.30f}, {0.62f, 0.42f, 0.70f}}};
  return colours[lane % most_lanes];
}

Viewport tile_of(std::size_t lane, std::size_t count, int width, int height) {
  const int rows = count > 3 || (count > 1 && height > width) ? 2 : 1, all = int(count);
  const int most = (all + rows - 1) / rows, row = int(lane) / most, column = int(lane) % most;
  const int columns = row + 1 < rows ? most : all - most * row;  // the last row's fill it
  const int left = width * column / columns, right = width * (column + 1) / columns;
  const int top = height - height * row / rows, bottom = height - height * (row + 1) / rows;
  return {left, bottom, right - left, top - bottom};
}

const std::vector<Comparison>& comparisons() {
  static const std::vector<Comparison> rows = {
      {"single", "no other beside it", {}},
      {"paper, node, cpu",
       "the paper's 25 iterations, 5 substeps with masses split, Gauss-Seidel",
       {"paper", "hard", "hard,mode=cpu-fast"}},
      {"5, 10, 20 substeps", "of one iteration", {"hard", "hard,substeps=10", "substeps"}},
      {"soft and hard",
       "neo-Hookean by forces, and k = 1",
       {"material=neo-hookean,mode=explicit", "material=none,hard"}},
      {"linear, smoothed",
       "tets of a neo-Hookean material, by forces: each by itself, and averaged around vertices",
       {"material=neo-hookean,mode=explicit,element=linear", "material=neo-hookean,mode=explicit,element=smoothed"}},
      {"forces, implicit, XPBD",
       "of soft bodies: leapfrog at half of what is stable, one implicit step, 20 substeps, 5",
       {"mode=explicit", "newton", "mode=node,iterations=1,substeps=20", "mode=node,iterations=1,substeps=5"}},
  };
  return rows;
}

bool shared_by_lanes(const Parameter& row) {
  return row.section == std::string_view("world") || row.name == "dt" || row.effect == Effect::restart;
}

Settings lane_settings(Settings settings, const std::string& words, const std::string& where,
                       const std::shared_ptr<const Model>& model, std::size_t bodies) {
  double budget_ms = 0;
  const std::size_t count = model ? model->bodies.size() : std::max(bodies, settings.bodies.size());
  std::vector<std::string> names = preset_names(solver_presets());
  for (const SolverMode& mode : solver_modes())
    if (!std::ranges::count(names, mode.name)) names.push_back(mode.name);
  for (const std::string& word : split(words, ',')) {
    if (const std::string budget = "budget_ms="; word.starts_with(budget)) {
      char* end = nullptr;
      budget_ms = std::strtod(word.c_str() + budget.size(), &end);
      if (*end || !(budget_ms > 0) || !std::isfinite(budget_ms))
        throw Error(fmt::format("'{}' is no time", word.substr(budget.size())), where,
                    "give milliseconds per step, as in budget_ms=0.5");
      continue;
    }
    const std::size_t equals = word.find('=');
    const Parameter* row = find_parameter(word.substr(0, equals));
    if (row && shared_by_lanes(*row))
      throw Error(fmt::format("{} is that of all lanes", row->name), where, "give it as a flag or in the scene");
    if (equals != std::string::npos)
      assign(settings, word.substr(0, equals), word.substr(equals + 1), where, count);
    else if (apply_preset(settings, solver_presets(), word) || apply_preset(settings, material_presets(), word))
      continue;
    else if (std::ranges::count(names, word))
      assign(settings, "mode", word, where, count);
    else
      throw Error(fmt::format("'{}' is no solver", word), where,
                  did_you_mean(word, names) + fmt::format("write PARAMETER=VALUE, budget_ms=MILLISECONDS or one of {}",
                                                          fmt::join(names, ", ")));
  }
  check_settings(settings, where);
  if (budget_ms > 0 && model) settings = choose_solver(model, settings, budget_ms, 400).settings();
  return settings;
}

long steps_of(const std::vector<Lane>& lanes) {
  long steps = 0;
  for (const Lane& lane : lanes) steps = std::max(steps, lane.steps());
  return steps;
}

std::size_t yardstick(const std::vector<Lane>& lanes) {
  const auto worth = [](const Lane& lane) { return lane.stopped() ? -1 : effort(lane); };
  return std::size_t(std::ranges::max_element(lanes, {}, worth) - lanes.begin());
}

std::size_t best_lane(const std::vector<Lane>& lanes) {
  const auto known = [](const Lane& lane) { return !lane.stopped() && lane.far().has_value(); };
  if (std::ranges::none_of(lanes, known)) return yardstick(lanes);
  const auto far = [&](const Lane& lane) { return known(lane) ? *lane.far() : 1e9f; };
  return std::size_t(std::ranges::min_element(lanes, {}, far) - lanes.begin());
}

void hold_lanes(std::vector<Lane>& lanes, const Motion* right) {
  const Model& model = *lanes.front().sim.model;
  const long now = steps_of(lanes);
  const long every = compared_every(model);
  State answer;
  if (right) {
    const auto kept = std::ranges::find(right->kept, now);
    if (kept == right->kept.end()) return;
    const long number = kept - right->kept.begin(), apart = right->kept.size() > 1 ? right->kept[1] : 1;
    if (number % std::max(1l, every / apart) != 0) return;
    answer.positions = right->positions[std::size_t(number)];
  } else {
    if (now % every != 0) return;
    answer = read_state(lanes[yardstick(lanes)].sim);
  }
  for (Lane& lane : lanes) {
    if (lane.stopped() || lane.steps() != now) continue;
    const double distance = error_to(model, answer, read_state(lane.sim));
    if (std::isfinite(distance)) lane.distance.add(100 * distance, lane.time());
  }
}

bool send_answers(const Motion& right, long step, Buffer& answers) {
  const auto kept = std::ranges::find(right.kept, step);
  if (kept == right.kept.end()) return false;
  std::vector<Position> positions;
  for (const glm::dvec3& p : right.positions[std::size_t(kept - right.kept.begin())]) {
    const glm::vec3 high(p);
    positions.push_back({high, 0, glm::vec3(p - glm::dvec3(high)), 0});
  }
  if (!answers) answers = Buffer("reference motion", positions, GL_STREAM_DRAW);
  answers.write(0, answers.bytes(), positions.data());
  return true;
}

void hold_vertices(std::vector<Lane>& lanes, const Motion* right, Renderer& renderer, Buffer& answers) {
  const long now = steps_of(lanes);
  if (right && !send_answers(*right, now, answers)) return;
  const Buffer& answer = right ? answers : lanes[yardstick(lanes)].positions();
  for (Lane& lane : lanes)
    if (!lane.stopped() && lane.steps() == now)
      measure_distances(renderer, lane.positions().id(), answer.id(), lane.sim.model->size, lane.apart);
}

}  // namespace tetpbd
