#include "sim/reference/motion.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <fstream>

#include "sim/contact/pairs.h"
#include "sim/error.h"
#include "sim/files.h"
#include "sim/hash.h"
#include "sim/interrupt.h"
#include "sim/mesh/cache.h"
#include "sim/model/material.h"
#include "sim/reference/implicit.h"
#include "sim/reference/leapfrog.h"
#include "sim/reference/rigid.h"

namespace tetpbd {

namespace {

// Steps are far shorter than what changes a motion to four digits.
constexpr double rigid_step_length = 4e-5;  // s
constexpr double part_of_stable = 0.5;      // of the longest stable step, in leapfrog steps
constexpr double ten_node_part = 0.7;       // likewise; what is told apart by them are meshes, whose errors are larger
constexpr double smoothed_part = 0.33;      // likewise; squeezed tets resist by themselves as well
constexpr long implicit_steps = 8;          // in a step of the scene
constexpr double most_stable = 3000;        // stable steps in a step of the scene; more of them cost more than Newton's
constexpr double most_bytes = 9e6;          // of stored positions, where these are `least_instants` or more
constexpr std::size_t least_instants = 21;
constexpr double seconds_between_saves = 20;

/// The same motion in longer and in shorter steps, advanced side by side.
struct TwoRuns {
  double step = 0;                         ///< s, the shorter
  std::function<void()> advance;           ///< advances both by a step of the scene
  std::function<State()> coarse, fine;     ///< the states of the one in longer and the one in shorter steps
  std::function<void(std::string&)> save;  ///< empty: not worth saving
  std::function<bool(std::string_view&)> load;
};

void require_reference(const ReferenceInput& input) {
  const Settings& settings = input.settings;
  const char* hint =
      "k = 1 for all kinds and free bodies has a rigid body's motion, compliance of all kinds a material's";
  const auto refuse = [&](const std::string& what) { throw Error("the scene has no reference motion", what, hint); };
  if (!input.model.fixtures.empty()) refuse("fixed vertices move");
  if (!input.model.attachments.empty()) refuse("bodies are attached to each other");
  if (!input.model.loads.empty()) refuse("forces beside gravity act");
  if (!input.model.fibres.empty()) refuse("fibres pull");
  if (any_material(settings, yields)) refuse("a body yields");
  const bool soft = any_material(settings, compliant);
  const auto check = [&](const Material& own) {
    if (!soft && !uses(own, Stretch::row)) refuse("without stretch constraints bodies have no shape to keep");
    for (std::size_t k = 0; own.material == "none" && k < kind_count; ++k) {
      if (!uses(own, constraint_kinds[k])) continue;
      if (own.stiffness[k] != 1) refuse(fmt::format("k_{} is {}", constraint_kinds[k].name, own.stiffness[k]));
      if (soft && own.compliance[k] == 0)
        refuse(fmt::format("compliance_{} is 0 and another is not", constraint_kinds[k].name));
    }
  };
  if (settings.bodies.empty()) return check(settings);
  for (const Body& body : input.model.bodies) check(material_of(settings, body.number));
}

// Runs of make(h), with `steps` of them and twice as many in a step of the scene. arrays(run, f) calls f for all arrays
// that a run consists of.
template <class Make, class Arrays>
TwoRuns make_runs(double dt, long steps, const Make& make, const Arrays& arrays) {
  using Run = decltype(make(dt));
  auto runs = std::make_shared<std::array<Run, 2>>(std::array{make(dt / double(steps)), make(dt / double(2 * steps))});
  TwoRuns result;
  result.step = (*runs)[1].h;
  result.advance = [runs, steps] { advance((*runs)[0], steps), advance((*runs)[1], 2 * steps); };
  result.coarse = [runs] { return make_state((*runs)[0]); };
  result.fine = [runs] { return make_state((*runs)[1]); };
  result.save = [runs, arrays](std::string& bytes) {
    for (Run& run : *runs) arrays(run, [&](auto& values) { put_array(bytes, values); });
  };
  result.load = [runs, arrays](std::string_view& bytes) {
    bool whole = true;
    for (Run& run : *runs) arrays(run, [&](auto& values) { whole = whole && take_array(bytes, values); });
    return whole;
  };
  return result;
}

struct RigidRun {
  ReferenceInput input;
  double h;
  std::vector<RigidBody> bodies;
};
void advance(RigidRun& run, long steps) {
  for (RigidBody& body : run.bodies)
    for (long s = 0; s < steps; ++s) advance(body, run.input.model, run.input.settings, run.h);
}
State make_state(const RigidRun& run) { return make_state(run.input.model, run.bodies); }

TwoRuns rigid_runs(const ReferenceInput& input) {
  const long steps = std::max(1L, std::lround(input.settings.dt / rigid_step_length));
  const auto make = [&](double h) { return RigidRun{input, h, rigid_bodies(input.model)}; };
  TwoRuns runs = make_runs(input.settings.dt, steps, make, [](RigidRun&, auto&&) {});
  runs.save = nullptr;  // a rigid motion takes seconds
  return runs;
}

TwoRuns leapfrog_runs(const ReferenceInput& input, double stable) {
  const State start{input.model.positions, input.model.velocities};
  const double part = input.ten_node                           ? ten_node_part
                      : input.system.averages.vertices.empty() ? part_of_stable
                                                               : smoothed_part;
  return make_runs(
      input.settings.dt, long(std::ceil(input.settings.dt / (part * stable))),
      [&](double h) { return leapfrog(input, reference_compliances(input), start, h); },
      [](Leapfrog& run, auto&& each) { each(run.x), each(run.v), each(run.time); });
}

TwoRuns implicit_runs(const ReferenceInput& input) {
  const State start{input.model.positions, input.model.velocities};
  return make_runs(
      input.settings.dt, implicit_steps,
      [&](double h) { return implicit(input, reference_compliances(input), start, h); },
      [](Implicit& run, auto&& each) {
        for (State* state : {&run.now, &run.before}) each(state->positions), each(state->velocities);
        each(run.anew), each(run.touching), each(run.time);
      });
}

// Saves an unfinished motion for a later run to continue. `key`, of the scene and the number of steps, is part of the
// file's checksum.
void save_unfinished(const std::filesystem::path& file, std::uint64_t key, const Motion& motion, const TwoRuns& runs) {
  std::string bytes;
  put_array(bytes, motion.rows), put_array(bytes, motion.kept);
  for (const Points& positions : motion.positions) put_array(bytes, positions);
  runs.save(bytes);
  seal(bytes, key);
  write_file(file, bytes);
}

bool load_unfinished(const std::filesystem::path& file, std::uint64_t key, Motion& motion, const TwoRuns& runs) {
  std::ifstream in(file, std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(in), {}};
  std::string_view bytes = text;
  if (!unseal(bytes, key)) return false;
  Motion loaded = motion;
  bool whole = take_array(bytes, loaded.rows) && take_array(bytes, loaded.kept);
  loaded.positions.resize(loaded.kept.size());
  for (Points& positions : loaded.positions) whole = whole && take_array(bytes, positions);
  if (whole && runs.load(bytes)) motion = loaded;
  return whole;
}

}  // namespace

Motion::Row measure_motion(const Model& model, const Settings& settings, const State& state, double time) {
  Motion::Row row;
  row.time = time;
  const double ground = settings.ground ? settings.ground_height : 0;
  double mass = 0;
  for (std::size_t i = 0; i < state.positions.size(); ++i) {
    const double m = model.masses[i];
    mass += m;
    row.centre += m * state.positions[i];
    row.velocity += m * state.velocities[i];
    row.kinetic += 0.5 * m * glm::dot(state.velocities[i], state.velocities[i]);
    row.potential += m * settings.gravity * (state.positions[i].y - ground);
  }
  row.centre /= mass, row.velocity /= mass;
  return row;
}

Compliances reference_compliances(const ReferenceInput& input) {
  Compliances compliances;
  for (std::size_t k = 0; k < kind_count; ++k)
    compliances[k] = input.system.present[k] && input.system.lists[k].compliance.empty()
                         ? input.settings.compliance[k]
                         : std::numeric_limits<double>::infinity();
  return compliances;
}

std::uint64_t scene_key(const ReferenceInput& input) {
  std::uint64_t key = fnv_basis;
  const auto add = [&](const auto& values) { key = hash_values(values, key); };
  const Model& model = input.model;
  add(model.rest.positions), add(model.rest.tets), add(model.positions), add(model.velocities);
  add(model.masses), add(input.inverse_masses);
  if (model.rest.thickness > 0) add(model.rest.surface);
  if (!model.regions.empty()) add(model.regions);
  for (const Obstacle& obstacle : model.obstacles) {
    add(obstacle_values(obstacle));
    if (obstacle.field) add(obstacle.field->values);
  }
  const Settings& s = input.settings;
  const auto add_material = [&](const Material& m) {
    for (std::size_t k = 0; m.material == "none" && k < kind_count; ++k)
      if (!constraint_kinds[k].of_material()) add(std::array{m.stiffness[k], m.compliance[k]});
    if (m.material == "none")
      add(m.constraints);
    else
      add(m.material), add(std::array{m.young_modulus, m.poisson_ratio});
    if (smoothed(in_mode(m, s))) add(m.element), add(std::array{smoothing_of(m)});
  };
  add_material(s);
  for (const BodySettings& body : s.bodies) {
    if (body.material) add_material(*body.material), add(std::array{body.material->constraint_damping});
    if (body.friction) add(std::array{*body.friction});
    for (const RegionModuli& region : body.regions)
      add(std::array{region.young_modulus.value_or(-1), region.poisson_ratio.value_or(-1)});
    if (body.restitution) add(std::string("restitution")), add(std::array{*body.restitution});
  }
  const double numbers[] = {s.constraint_damping, s.dt,       s.damping,    s.gravity, double(s.ground),
                            s.ground_height,      s.friction, s.restitution};
  add(numbers);
  if (bodies_touch(model, s)) add(s.contact + ", offsets"), add(std::array{s.contact_distance});
  return key;
}

std::uint64_t scene_key(const Model& model, const Settings& settings) {
  return scene_key({model, {}, settings, model.inverse_masses});
}

namespace {

// Those of no mode, so that tets are not smoothed.
Settings of_linear_tets(Settings settings) {
  settings.mode.clear();
  return settings;
}

}  // namespace

std::uint64_t motion_key(const Model& model, const Settings& settings, const std::string& method) {
  if (method == "ten-node") return hash_values(method, scene_key(model, of_linear_tets(settings)));
  return scene_key(model, settings);
}

namespace {

Motion find_ten_node_motion(const ReferenceInput& input, long steps, const std::filesystem::path& unfinished,
                            const std::function<void(long)>& progress) {
  const auto is_elastic = [](const Material& m) { return m.material != "none"; };
  const bool all_elastic = std::ranges::all_of(input.model.bodies, [&](const Body& body) {
    return !body.is_sheet() && is_elastic(material_of(input.settings, body.number));
  });
  if (!all_elastic)
    throw Error("the bodies have no motion on finer meshes", "constraints alone, or a sheet",
                "give them a material, which does not depend on the mesh");
  const Halved halved = halve_edges(input.model);
  const ConstraintSystem system = build_constraints(halved.model, of_linear_tets(input.settings));
  Motion motion = find_motion({halved.model, system, input.settings, halved.model.inverse_masses, true}, steps,
                              "leapfrog", unfinished, progress);
  motion.method = "ten-node", motion.scene = motion_key(input.model, input.settings, motion.method);
  for (Points& positions : motion.positions) {
    Points corners(halved.corner.size());
    for (std::size_t i = 0; i < corners.size(); ++i) corners[i] = positions[halved.corner[i]];
    positions = std::move(corners);
  }
  return motion;
}

}  // namespace

Motion find_motion(const ReferenceInput& input, long steps, const std::string& method,
                   const std::filesystem::path& unfinished, const std::function<void(long)>& progress) {
  if (method == "ten-node") return find_ten_node_motion(input, steps, unfinished, progress);
  require_reference(input);
  Motion motion;
  motion.method = method;
  const bool soft = any_material(input.settings, compliant);
  const double stable =
      !soft || method == "implicit" ? 0 : stable_step(input, reference_compliances(input), input.model.rest.positions);
  const bool touching = bodies_touch(input.model, input.settings);
  if (method.empty())
    motion.method = !soft                                                   ? "rigid body"
                    : !touching && most_stable * stable < input.settings.dt ? "implicit"
                                                                            : "leapfrog";
  if (touching && motion.method != "leapfrog")
    throw Error("no reference motion of bodies that touch each other", motion.method,
                "give them a material, and use leapfrog");
  if ((motion.method == "rigid body") == soft)
    throw Error("no method for this scene", method,
                "with compliance or a material leapfrog or implicit, for k = 1 a rigid body");
  const TwoRuns runs = motion.method == "implicit"   ? implicit_runs(input)
                       : motion.method == "leapfrog" ? leapfrog_runs(input, stable)
                                                     : rigid_runs(input);
  motion.scene = scene_key(input);
  motion.dt = input.settings.dt, motion.step = runs.step;
  const double instant_bytes = double(input.model.masses.size() * sizeof(glm::dvec3));
  const auto instants = std::max(least_instants, std::size_t(most_bytes / instant_bytes));
  const long keep_every = long(std::ceil(double(steps) / double(instants - 1)));
  const auto add = [&](long step) {
    const State fine = runs.fine();
    motion.rows.push_back(measure_motion(input.model, input.settings, fine, double(step) * motion.dt));
    motion.rows.back().error = error_to(input.model, fine, runs.coarse());
    if (step % keep_every != 0 && step != steps) return;
    motion.kept.push_back(step);
    motion.positions.push_back(fine.positions);
  };
  const bool resumable = runs.save && !unfinished.empty();
  const std::uint64_t key = hash_values(motion.method, hash_values(std::array{steps}, motion.scene));
  if (!resumable || !load_unfinished(unfinished, key, motion, runs)) add(0);
  auto saved = std::chrono::steady_clock::now();
  for (long step = long(motion.rows.size()); step <= steps; ++step) {
    runs.advance();
    add(step);
    if (progress) progress(step);
    const auto now = std::chrono::steady_clock::now();
    const bool stop = interrupted();
    if (resumable && (stop || std::chrono::duration<double>(now - saved).count() > seconds_between_saves)) {
      save_unfinished(unfinished, key, motion, runs);
      saved = now;
    }
    if (stop) throw Interrupted();
  }
  std::error_code ignored;
  if (resumable) std::filesystem::remove(unfinished, ignored);
  return motion;
}

bool is_kept(const Motion& motion, long step) { return std::ranges::binary_search(motion.kept, step); }

void add_state(MotionError& error, const Motion& motion, const Model& model, long step, const State& state) {
  const auto found = std::ranges::find(motion.kept, step);
  if (found == motion.kept.end()) return;
  const State reference{motion.positions[std::size_t(found - motion.kept.begin())], {}}, start{motion.positions[0], {}};
  error.final = error_to(model, reference, state);
  const double moved = error_to(model, start, reference);
  error.relative = moved > 0 ? error.final / moved : 0;
  error.peak = std::max(error.peak, error.final);
  const double squares = error.rms * error.rms * double(error.instants) + error.final * error.final;
  error.rms = std::sqrt(squares / double(++error.instants));
}

}  // namespace tetpbd
