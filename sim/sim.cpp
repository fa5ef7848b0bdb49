#include "sim/sim.h"

#include <fmt/format.h>

#include <tuple>

#include "sim/contact/moving_obstacle.h"
#include "sim/contact/rigid_contact.h"
#include "sim/error.h"
#include "sim/gl/keep_bindings.h"
#include "sim/model/material.h"

namespace tetpbd {
namespace {

// Fills in the driver's limits where nothing lower is asked for.
Tuning within_limits(Tuning tuning) {
  const unsigned row = unsigned(most_work_groups_in_row());
  if (tuning.row == 0 || tuning.row > row) tuning.row = row;
  const std::size_t storage = std::size_t(capabilities().storage_bytes);
  if (tuning.storage == 0 || tuning.storage > storage) tuning.storage = storage;
  return tuning;
}

// Everything but the state.
Sim make_sim(std::shared_ptr<const Model> model, const Settings& settings, const Tuning& tuning,
             ConstraintSystem system) {
  Sim sim;
  sim.shader_version = shader_folder_version();
  sim.model = std::move(model);
  sim.settings = settings;
  sim.plan = plan_for(settings);
  sim.tuning = within_limits(tuning);
  sim.masses = sim.model->masses, sim.inverse_masses = sim.model->inverse_masses;
  sim.system = std::move(system);
  const std::size_t count = sim.model->positions.size();
  SolverInput input{*sim.model, sim.system, sim.settings, sim.plan, sim.tuning, is_software_renderer()};
  input.compliant = any_material(settings, compliant);
  input.rigid = any_moves_rigidly(settings);
  if (const std::vector<float> fineness = quantum_fineness(*sim.model, settings); !fineness.empty() && !on_cpu(sim)) {
    std::tie(sim.fineness, sim.fineness_texture) =
        make_texels("fineness of quanta", fineness, "make bodies of more similar size");
    input.fine_quanta = true;
  }
  const auto defines = sim.led.defines = vertex_defines(input);
  sim.obstacles = make_obstacles(*sim.model, settings);
  sim.solver = solver_mode(settings).create(input);
  sim.solver.retune(sim, nullptr);
  const auto buffer = [&](const char* label, std::size_t bytes) {
    check_storage(sim.tuning, label, bytes);
    return Buffer(label, bytes);
  };
  sim.step_block = Buffer("step", sizeof(Step));
  sim.positions = buffer("positions", count * sizeof(Position));
  sim.velocities = buffer("velocities", (sim.solver.keeps_prediction ? 2 : 1) * count * sizeof(Velocity));
  sim.recorder.row = sim.tuning.row, sim.recorder.storage = sim.tuning.storage;
  sim.yielding = make_yielding(input, sim.solver);
  if (on_cpu(sim)) return sim;
  const std::size_t quantized_bytes = count * 16 * (input.compliant ? 2 : 1);
  if (sim.solver.quantized_buffers > 0) sim.quantized[0] = buffer("quantized positions", quantized_bytes);
  if (sim.solver.quantized_buffers > 1) sim.quantized[1] = buffer("quantized positions, other side", quantized_bytes);
  if (input.rigid) {
    sim.rigid_bodies = buffer("hard bodies", sim.model->bodies.size() * sizeof(RigidRecord) + 8 * count);
    sim.rigid_contact = {Program::compute("contact/rigid_contact.comp", {}, defines), work_groups(count, 256),
                         4 * count};
  }
  if (bodies_touch(*sim.model, settings)) sim.pairs = make_pairs(input);
  sim.faces = make_faces(input);
  sim.loads = make_loads(*sim.model);
  if (sim.tuning.count_guards) sim.guard_counts = Buffer("guard counts", GUARDS * sizeof(GLuint));
  sim.check.words = Buffer("check", std::vector<GLuint>(4 + DROPS), GL_DYNAMIC_COPY);
  sim.check.read_back = Buffer("check read-back", 8, nullptr, GL_STREAM_READ);
  sim.check.copy = {Program::compute("checkpoint.comp")};
  if (sim.solver.watches) {
    sim.adaptive.readback = Buffer("watch read-back", 8, nullptr, GL_STREAM_READ);
    sim.adaptive.nothing = Buffer("nothing", 8, std::array{0.0f, 1.0f}.data());
  }
  return sim;
}

// Takes over the constraints of other settings, if they differ from the present ones in numbers alone.
bool adopt_constraints(Sim& sim, const Settings& settings) {
  if (same_constraints(settings, sim.settings)) return true;
  if (!sim.solver.takes_constraints || any_material(settings, yields)) return false;
  ConstraintSystem system = build_constraints(*sim.model, settings, sim.broken);
  const auto like = [](const ConstraintList& a, const ConstraintList& b) {
    return a.count() == b.count() && a.compliance.size() == b.compliance.size();
  };
  if (!std::ranges::equal(system.lists, sim.system.lists, like)) return false;
  sim.system = std::move(system);
  return true;
}

// Makes a whole simulation beside the old one, which stays as it was where memory or a shader fails.
void remake(Sim& sim, const Settings& settings, const std::shared_ptr<const Model>& model) {
  if (check_finite(sim, true)) restore_checkpoint(sim);
  State state = read_state(sim);
  Sim fresh = make_sim(
      model, settings, sim.tuning,
      same_constraints(settings, sim.settings) ? sim.system : build_constraints(*sim.model, settings, sim.broken));
  fresh.broken = sim.broken;
  for (std::size_t v = 0; v < sim.inverse_masses.size(); ++v)
    if (is_pinned(sim, std::uint32_t(v))) fresh.inverse_masses[v] = 0;
  fresh.steps = sim.steps, fresh.guards = guard_counts(sim);
  fresh.origin = settings.dt == sim.settings.dt ? sim.origin : TimeOrigin{sim.steps, simulated_time(sim)};
  fresh.timed = sim.timed;
  start_with(fresh, std::move(state), half_substep_fall(sim.settings, sim.plan));
  fresh.led.vertices = sim.led.vertices, fresh.led.places = sim.led.places;
  sim = std::move(fresh);
}

void add_upwards(const Sim& sim, State& state, double speed) {
  if (speed == 0) return;
  for (std::size_t i = 0; i < state.velocities.size(); ++i)
    if (sim.inverse_masses[i] > 0) state.velocities[i].y += speed;
}

// Takes over settings for which the kernels stay. Throws where the solver cannot.
void adopt_settings(Sim& sim, const Settings& settings) {
  const TimeOrigin origin = sim.origin;
  if (settings.dt != sim.settings.dt) sim.origin = {sim.steps, simulated_time(sim)};
  const Settings before = std::exchange(sim.settings, settings);
  const double fall = half_substep_fall(before, sim.plan);
  const Plan plan = std::exchange(sim.plan, plan_for(settings));
  const std::vector<double> masses = sim.masses;
  try {
    sim.solver.retune(sim, &before);
  } catch (...) {
    sim.settings = before, sim.plan = plan, sim.origin = origin;
    throw;
  }
  sim.yielding.copied = false;  // retune() may have written rest values of the start
  forget_readbacks(sim);
  write_step_block(sim);
  write_surfaces(sim);
  const double upwards = half_substep_fall(sim.settings, sim.plan) - fall;
  const bool heavier = sim.masses != masses;
  if (upwards == 0 && !heavier) return;
  State state = read_state(sim);
  add_upwards(sim, state, upwards);
  heavier ? upload(sim, state) : write_velocities(sim, state);
  if (on_cpu(sim)) sim.host = std::move(state);
}

void clear_drops(Sim& sim) {
  sim.check.words.write(4 * sizeof(GLuint), DROPS * sizeof(GLuint), std::array<GLuint, DROPS>{}.data());
}

}  // namespace

// Semi-implicit Euler started half a substep back is leapfrog: velocities are those of mid-substep, and a
// constant acceleration is integrated exactly (method.md eq. 3).
double half_substep_fall(const Settings& settings, const Plan& plan) {
  return solver_mode(settings).implicit ? 0 : 0.5 * plan.h * settings.gravity;
}

Sim create_sim(std::shared_ptr<const Model> model, const Settings& settings, const Tuning& tuning) {
  const KeepBindings kept;
  check_settings(*model, settings);
  ConstraintSystem system = build_constraints(*model, settings);
  Sim sim = make_sim(std::move(model), settings, tuning, std::move(system));
  reset(sim);
  return sim;
}

bool same_constraints(const Settings& a, const Settings& b) {
  const auto decides = [](const Settings& s) {
    const bool dashpots = s.material == "neo-hookean";
    return std::tuple(
        kinds_in_use(in_mode(s, s)), s.material, s.young_modulus, s.poisson_ratio, smoothing_of(s),
        dashpots ? std::tuple(s.constraint_damping, s.viscosity, s.bulk_viscosity) : std::tuple(0.0, 0.0, 0.0),
        std::tuple(s.yield_strain, s.creep_time), solver_mode(s).smoothed, solver_mode(s).forces);
  };
  // Where bodies have materials of their own, constraints also contain numbers of the settings.
  const auto numbers = [](const Settings& s) { return std::tuple(s.stiffness, s.compliance, s.constraint_damping); };
  const auto same = [](const BodySettings& one, const BodySettings& other) {
    return one.material == other.material && one.regions == other.regions;
  };
  return decides(a) == decides(b) && std::ranges::equal(a.bodies, b.bodies, same) &&
         (!has_own_materials(a) || numbers(a) == numbers(b));
}

void change_obstacles(Sim& sim, std::shared_ptr<const Model> model) {
  const KeepBindings kept;
  if (!share_kernels(*sim.model, *model) || wide_faces(*sim.model) != wide_faces(*model))
    return remake(sim, sim.settings, model);
  sim.model = std::move(model);
  write_step_block(sim);
}

void reset(Sim& sim) {
  const KeepBindings kept;
  set_broken(sim, {});
  if (sim.guard_counts) sim.guard_counts.clear();
  if (sim.check.words) clear_drops(sim);
  sim.guards = {};
  for (std::size_t v = 0; v < sim.masses.size(); ++v) sim.inverse_masses[v] = free_inverse_mass(sim, v);
  forget_all(sim);
  start_with(sim, {sim.model->positions, sim.model->velocities}, 0);
}

void set_broken(Sim& sim, const std::vector<char>& broken) {
  if (broken == sim.broken) return;
  sim.broken = broken;
  sim.system = build_constraints(*sim.model, sim.settings, broken);
  remake(sim, sim.settings, sim.model);
}

void forget_all(Sim& sim) {
  static_cast<StepValues&>(sim) = {};
  static_cast<PairNumbers&>(sim.pairs) = {};
}

void start_with(Sim& sim, State state, double fall) {
  const KeepBindings kept;
  forget_readbacks(sim);
  sim.led.vertices.clear(), sim.led.places.clear();
  start_pairs(sim, state);
  sim.solver.start(sim, state);  // may change the plan, on which the fall depends
  add_upwards(sim, state, half_substep_fall(sim.settings, sim.plan) - fall);
  if (on_cpu(sim)) sim.host = state;
  upload(sim, state);
  sim.quantum = choose_quantum(sim, state);
  write_step_block(sim);
  start_check(sim, &state);
}

void write_state(Sim& sim, const State& state) { start_with(sim, state, half_substep_fall(sim.settings, sim.plan)); }

Carried carried(Sim& sim) {
  Carried all;
  if (on_cpu(sim)) return all;
  all.add(sim.positions);
  all.ranges.push_back({&sim.velocities, 0, sim.masses.size() * sizeof(Velocity)});
  if (sim.yielding) all.add(sim.yielding.records);  // here, where snapshot.cpp looks for it
  if (sim.quantized[0]) all.add(sim.quantized[sim.read_index]);
  if (sim.rigid_bodies) all.add(sim.rigid_bodies);
  sim.solver.carried(sim, all);
  add_carried(all, sim.adaptive, sim.check.words);
  add_carried(all, sim.pairs);
  return all;
}

void apply_settings(Sim& sim, const Settings& settings) {
  const KeepBindings kept;
  check_settings(*sim.model, settings);
  const auto made_for = [&](const Settings& s) {
    return std::tuple(s.mode, any_material(s, compliant), any_moves_rigidly(s), s.contact, s.contact_distance,
                      has_obstacles(*sim.model, s), has_own_materials(s), has_own_surfaces(s), s.acceleration > 0);
  };
  if (made_for(settings) == made_for(sim.settings) && adopt_constraints(sim, settings))
    adopt_settings(sim, settings);
  else
    remake(sim, settings, sim.model);
}

void rebuild_shaders(Sim& sim) {
  const KeepBindings kept;
  remake(sim, sim.settings, sim.model);
}

void add_guards(Sim& sim, const GuardCounts& counts) {
  for (std::size_t g = 0; g < counts.size(); ++g) sim.guards[g] += counts[g];
}

GuardCounts guard_counts(Sim& sim) {
  const KeepBindings kept;
  if (sim.guard_counts) {
    glMemoryBarrier(GL_ATOMIC_COUNTER_BARRIER_BIT);
    const auto now = sim.guard_counts.read_all<GLuint>();
    for (std::size_t g = 0; g < GUARDS; ++g) sim.guards[g] += now[g];
    sim.guard_counts.clear();
  }
  if (sim.check.words) {
    std::array<GLuint, DROPS> now{};
    sim.check.words.read(4 * sizeof(GLuint), sizeof now, now.data());
    for (std::size_t d = 0; d < DROPS; ++d) sim.guards[GUARDS + d] += now[d];
    if (now != std::array<GLuint, DROPS>{}) clear_drops(sim);
  }
  return sim.guards;
}

std::vector<std::pair<std::string, std::uint64_t>> dropped(Sim& sim) {
  const GuardCounts counts = guard_counts(sim);
  std::vector<std::pair<std::string, std::uint64_t>> all;
  const auto add = [&](const char* name, std::uint64_t count) {
    if (count > 0) all.emplace_back(name, count);
  };
  for (std::size_t d = 0; d < DROPS; ++d) add(drop_names[d], counts[GUARDS + d]);
  add("contact_pairs", touched(sim).left_out);
  return all;
}

}  // namespace tetpbd
