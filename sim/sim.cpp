#include "sim/sim.h"

#include <fmt/format.h>

#include <bit>
#include <cmath>
#include <limits>
#include <numeric>
#include <span>
#include <tuple>

#include "sim/contact/moving_obstacle.h"
#include "sim/error.h"
#include "sim/hash.h"
#include "sim/keep_bindings.h"
#include "sim/material.h"
#include "sim/parallel.h"
#include "sim/solvers/cpu_pbd.h"
#include "sim/solvers/substep.h"

namespace tetpbd {

// Not inlined: GCC 12.2 at -O3 vectorises callers' loops and takes float(x) for x in the left-over elements,
// so that their low parts are lost (a test guards against it).
[[gnu::noinline]] void split_pair(const glm::dvec3& value, glm::vec3& high, glm::vec3& low) {
  for (int a = 0; a < 3; ++a) {
    const volatile float rounded = float(value[a]);
    high[a] = rounded;
    low[a] = float(value[a] - double(rounded));
  }
}

namespace {

constexpr unsigned group_size = 256;  // of rigid_contact

Position to_gpu(const glm::dvec3& x, double inverse_mass, std::uint32_t constraints) {
  Position p{};
  split_pair(x, p.high, p.low);
  p.inverse_mass = float(inverse_mass);
  p.constraints = float(constraints);
  return p;
}

// The quantum: a power of two, so that multiplying by it is exact, and small, with room for vertices
// of a constraint 16 sizes apart (of the largest body, or of what the state stretches most). Everything that
// is computed from quantized positions is blurred by it.
double quantum_of(const Sim& sim, const State& state) {
  double reach = sim.model->size;
  for (const ConstraintList& list : sim.system.lists) {
    const std::size_t arity = std::size_t(list.arity);
#pragma omp parallel for reduction(max : reach)
    for (std::size_t c = 0; c < list.vertices.size(); c += arity)
      for (std::size_t j = 1; j < arity; ++j) {
        const double apart =
            glm::length(state.positions[list.vertices[c + j]] - state.positions[list.vertices[c]]);
        if (apart > reach && std::isfinite(apart)) reach = apart;
      }
  }
  return std::exp2(std::ceil(std::log2(reach)) - 27);
}

// As they are before anything is known of the bodies' motion.
std::vector<RigidRecord> rigid_records(const Model& model, const Settings& settings) {
  std::vector<RigidRecord> records;
  for (const Body& body : model.bodies) {
    RigidRecord& record = records.emplace_back();
    record.first = unsigned(body.first_vertex), record.vertices = unsigned(body.vertices);
    record.one_piece = body.one_piece && rigid_in_contact(settings, body_material(body, settings));
    const auto mass = model.masses.begin() + std::ptrdiff_t(body.first_vertex);
    record.mass = float(std::accumulate(mass, mass + std::ptrdiff_t(body.vertices), 0.0));
  }
  return records;
}

// What the driver allows, where nothing lower is asked for.
Tuning within_limits(Tuning tuning) {
  const unsigned row = unsigned(most_work_groups_in_row());
  if (tuning.lanes == 0) tuning.lanes = is_software_renderer() ? 1 : 8;  // there, one after the other
  if (tuning.lanes > 8 || !std::has_single_bit(tuning.lanes))
    throw Error("no such tuning", fmt::format("lanes={}", tuning.lanes), "a power of two up to 8");
  if (tuning.row == 0 || tuning.row > row) tuning.row = row;
  const std::size_t storage = std::size_t(capabilities().storage_bytes);
  if (tuning.storage == 0 || tuning.storage > storage) tuning.storage = storage;
  return tuning;
}

SolverInput solver_input(const Sim& sim) {
  const Settings& s = sim.settings;
  return {*sim.model,
          sim.system,
          s,
          sim.plan,
          sim.tuning,
          is_software_renderer(),
          any_material(*sim.model, s, compliant),
          touches_rigidly(*sim.model, s)};
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
  sim.inverse_masses = sim.model->inverse_masses;
  sim.system = std::move(system);
  const std::size_t count = sim.model->positions.size();
  const SolverInput input = solver_input(sim);
  const auto defines = vertex_defines(input);
  sim.obstacles = make_obstacles(*sim.model);
  sim.solver = mode_of(settings).create(input);
  sim.solver.retune(sim, nullptr);
  const auto buffer = [&](const char* label, std::size_t bytes) {
    check_storage(sim.tuning, label, bytes);
    return Buffer(label, bytes);
  };
  sim.step_block = Buffer("step", sizeof(Step));
  sim.positions = buffer("positions", count * sizeof(Position));
  sim.velocities = buffer("velocities", count * sizeof(Velocity));
  sim.recorder.row = sim.tuning.row, sim.recorder.storage = sim.tuning.storage;
  if (on_cpu(sim)) return sim;
  if (sim.solver.keeps_prediction) sim.predicted = buffer("predicted", count * sizeof(Velocity));
  const std::size_t quantized_bytes = count * 16 * (input.compliant ? 2 : 1);
  if (sim.solver.quantized_buffers > 0) sim.quantized[0] = buffer("quantized positions", quantized_bytes);
  if (sim.solver.quantized_buffers > 1)
    sim.quantized[1] = buffer("quantized positions, other side", quantized_bytes);
  if (input.rigid) {
    sim.rigid_bodies = buffer("hard bodies", sim.model->bodies.size() * sizeof(RigidRecord) + 8 * count);
    sim.rigid_contact = {Program::compute("contact/rigid_contact.comp", {}, defines),
                         work_groups(count, group_size), 4 * count};
  }
  if (bodies_touch(*sim.model, settings)) sim.pairs = make_pairs(input);
  if (sim.tuning.count_guards) sim.guard_counts = Buffer("guard counts", GUARDS * sizeof(GLuint));
  sim.check.words = Buffer("check", std::vector<GLuint>(4 + DROPS), GL_DYNAMIC_COPY);
  sim.check.read_back = Buffer("check read-back", 8, nullptr, GL_STREAM_READ);
  sim.check.copy = {Program::compute("checkpoint.comp")};
  if (sim.solver.watches) {
    sim.watch.answer = Buffer("watch read-back", 8, nullptr, GL_STREAM_READ);
    sim.watch.nothing = Buffer("nothing", 8, std::array{0.0f, 1.0f}.data());
  }
  return sim;
}

// The constraints of other settings, if the solver needs only be told their numbers.
bool adopt_constraints(Sim& sim, const Settings& settings) {
  if (same_constraints(*sim.model, settings, sim.settings)) return true;
  if (!sim.solver.takes_constraints) return false;
  ConstraintSystem system = build_constraints(*sim.model, settings);
  const auto like = [](const ConstraintList& a, const ConstraintList& b) {
    return a.count() == b.count() && a.compliance.size() == b.compliance.size();
  };
  if (!std::ranges::equal(system.lists, sim.system.lists, like)) return false;
  sim.system = std::move(system);
  return true;
}

// Made whole beside the old one: no room, or a shader that does not compile, leaves that running.
void remake(Sim& sim, const Settings& settings, const std::shared_ptr<const Model>& model) {
  if (check_finite(sim, true)) restore_checkpoint(sim);  // it has nothing better to start from
  State state = read_state(sim);
  Sim fresh = make_sim(model, settings, sim.tuning,
                       same_constraints(*sim.model, settings, sim.settings)
                           ? sim.system
                           : build_constraints(*sim.model, settings));
  fresh.inverse_masses = sim.inverse_masses;
  fresh.steps = sim.steps, fresh.guards = guard_counts(sim);
  fresh.origin = settings.dt == sim.settings.dt ? sim.origin : TimeOrigin{sim.steps, time_of(sim)};
  fresh.timed = sim.timed;
  start_with(fresh, std::move(state), half_substep_fall(sim.settings, sim.plan));
  sim = std::move(fresh);
}

void add_upwards(const Sim& sim, State& state, double speed) {
  if (speed == 0) return;
  for (std::size_t i = 0; i < state.velocities.size(); ++i)
    if (sim.inverse_masses[i] > 0) state.velocities[i].y += speed;
}

void write_velocities(const Sim& sim, const State& state) {
  std::vector<Velocity> velocities(state.velocities.size());
  parallel_for(velocities.size(), [&](std::size_t i) {
    split_pair(state.velocities[i], velocities[i].high, velocities[i].low);
  });
  sim.velocities.write(0, velocities.size() * sizeof(Velocity), velocities.data());
}

// What is decided from a state before its first step.
void start_from(Sim& sim, const State& state) {
  forget_answers(sim);
  start_pairs(sim, state);
  sim.solver.start(sim, state);
}

void adopt(Sim& sim, const State& state) {
  if (on_cpu(sim)) sim.host = state;
  upload(sim, state);
  sim.quantum = quantum_of(sim, state);
  write_step_block(sim);
  start_check(sim, &state);
}

// Velocities of mid-substep that were `fall` behind become those with the settings and the plan of now.
void retime_velocities(Sim& sim, double fall) {
  const double upwards = half_substep_fall(sim.settings, sim.plan) - fall;
  if (upwards == 0) return;
  State state = read_state(sim);
  add_upwards(sim, state, upwards);
  write_velocities(sim, state);
  if (on_cpu(sim)) sim.host = std::move(state);
}

}  // namespace

// Semi-implicit Euler started half a substep back is leapfrog: velocities are those of mid-substep, and a
// constant acceleration is integrated exactly (method.md eq. 3).
double half_substep_fall(const Settings& settings, const Plan& plan) {
  return mode_of(settings).implicit ? 0 : 0.5 * plan.h * settings.gravity;
}

Sim create_sim(std::shared_ptr<const Model> model, const Settings& settings, const Tuning& tuning) {
  const KeepBindings kept;
  check_settings(*model, settings);
  ConstraintSystem system = build_constraints(*model, settings);
  Sim sim = make_sim(std::move(model), settings, tuning, std::move(system));
  reset(sim);
  return sim;
}

bool same_constraints(const Model& model, const Settings& a, const Settings& b) {
  const auto decides = [](const Settings& s) {
    const bool dashpots = s.material == "neo-hookean";
    return std::tuple(kinds_in_use(s), s.material, s.young_modulus, s.poisson_ratio,
                      dashpots ? s.constraint_damping : 0);
  };
  // Where bodies differ, constraints carry the settings' numbers too.
  const auto numbers = [](const Settings& s) {
    return std::tuple(s.stiffness, s.compliance, s.constraint_damping);
  };
  return decides(a) == decides(b) && (!has_own_materials(model) || numbers(a) == numbers(b));
}

void write_step_block(Sim& sim, int substeps_before) {
  const Settings& s = sim.settings;
  const double h = sim.plan.h;
  const bool soft = any_material(*sim.model, s, compliant);
  Step block{};
  block.gravity = {0.0f, float(-s.gravity), 0.0f};
  block.h = float(h);
  block.inverse_h = float(1 / h);
  block.omega = soft ? 1.0f : float(s.omega);
  block.share = mode_of(s).leapfrog ? 0.0f : float(1 / s.omega);
  block.friction = float(s.friction);
  block.drag = float(s.damping);
  block.kick = substeps_before ? float(0.5 * (1 + double(sim.plan.substeps) / substeps_before)) : 1;
  block.restitution = float(s.restitution);
  block.body_size = float(sim.model->size);
  block.velocity_scale = float(std::exp(-s.damping * h));
  block.max_correction = float(longest_correction(*sim.model, s));
  block.correction_quantum = float(longest_correction(*sim.model, s) / double(1 << 30));
  block.mass_splitting = splits_masses(*sim.model, s);
  block.quantum = float(sim.quantum);
  block.inverse_quantum = float(1 / sim.quantum);
  block.quantized_size = float(sim.quantum / double(std::numeric_limits<float>::epsilon()));
  block.vertex_count = unsigned(sim.model->positions.size());
  block.damping = float(most_damping(*sim.model, s) / h);
  block.turn_limit = float(TURN_LIMIT / sim.watch.finer);
  write_planes(*sim.model, s, block);
  for (std::size_t k = 0; k < kind_count; ++k) {
    block.stiffness[k / 4][glm::length_t(k % 4)] = float(s.stiffness[k]);
    block.compliance[k / 4][glm::length_t(k % 4)] = float(s.compliance[k] / (h * h));
  }
  sim.step_block.write(0, sizeof block, &block);
  write_obstacles(sim);
  sim.needs_predict = true;  // the quantized positions hold a prediction with the old h and gravity
}

void forget_contacts(Sim& sim) {
  if (!sim.rigid_bodies) return;
  const auto records = rigid_records(*sim.model, sim.settings);
  sim.rigid_bodies.write(0, records.size() * sizeof(RigidRecord), records.data());
}

void change_obstacles(Sim& sim, std::shared_ptr<const Model> model) {
  const KeepBindings kept;
  if (!share_kernels(*sim.model, *model)) return remake(sim, sim.settings, model);
  sim.model = std::move(model);
  write_step_block(sim);
}

static void clear_drops(Sim& sim) {
  sim.check.words.write(4 * sizeof(GLuint), DROPS * sizeof(GLuint), std::array<GLuint, DROPS>{}.data());
}

void reset(Sim& sim) {
  const KeepBindings kept;
  if (sim.guard_counts) sim.guard_counts.clear();
  if (sim.check.words) clear_drops(sim);
  sim.guards = {};
  sim.inverse_masses = sim.model->inverse_masses;
  forget_all(sim);
  start_with(sim, {sim.model->positions, sim.model->velocities}, 0);
}

void forget_all(Sim& sim) {
  static_cast<StepValues&>(sim) = {};
  static_cast<PairNumbers&>(sim.pairs) = {};
}

void start_with(Sim& sim, State state, double fall) {
  const KeepBindings kept;
  start_from(sim, state);
  add_upwards(sim, state, half_substep_fall(sim.settings, sim.plan) - fall);
  adopt(sim, state);
}

void write_state(Sim& sim, const State& state) {
  start_with(sim, state, half_substep_fall(sim.settings, sim.plan));
}

Carried carried(Sim& sim) {
  Carried all;
  if (on_cpu(sim)) return all;
  all.add(sim.positions), all.add(sim.velocities);
  if (sim.quantized[0]) all.add(sim.quantized[sim.read_index]);
  if (sim.rigid_bodies) all.add(sim.rigid_bodies);
  sim.solver.carried(sim, all);
  add_carried(all, sim.watch, sim.check.words);
  add_carried(all, sim.pairs);
  return all;
}

void upload(Sim& sim, const State& state) {
  std::vector<Position> positions(state.positions.size());
  parallel_for(positions.size(), [&](std::size_t i) {
    positions[i] = to_gpu(state.positions[i], sim.inverse_masses[i], sim.system.at_vertex[i]);
  });
  sim.positions.write(0, positions.size() * sizeof(Position), positions.data());
  write_velocities(sim, state);
  sim.needs_predict = true;
}

namespace {

// The kernels stay. Throws where the solver cannot take the settings.
void adopt_settings(Sim& sim, const Settings& settings) {
  const TimeOrigin origin = sim.origin;
  if (settings.dt != sim.settings.dt) sim.origin = {sim.steps, time_of(sim)};
  const Settings before = std::exchange(sim.settings, settings);
  const double fall = half_substep_fall(before, sim.plan);
  const Plan plan = std::exchange(sim.plan, plan_for(settings));
  try {
    sim.solver.retune(sim, &before);
  } catch (...) {
    sim.settings = before, sim.plan = plan, sim.origin = origin;
    throw;
  }
  forget_answers(sim);
  write_step_block(sim);
  retime_velocities(sim, fall);
}

}  // namespace

void apply_settings(Sim& sim, const Settings& settings) {
  const KeepBindings kept;
  check_settings(*sim.model, settings);
  const auto made_for = [&](const Settings& s) {
    return std::tuple(s.mode, any_material(*sim.model, s, compliant), touches_rigidly(*sim.model, s),
                      s.contact);
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
  const PairNumbers pairs = touched(sim);
  std::vector<std::pair<std::string, std::uint64_t>> all;
  for (std::size_t d = 0; d < DROPS; ++d) all.emplace_back(drop_names[d], counts[GUARDS + d]);
  all.emplace_back("contact_candidates", pairs.crowded), all.emplace_back("contact_speed", pairs.outrun);
  std::erase_if(all, [](const auto& item) { return item.second == 0; });
  return all;
}

State state_of(const std::vector<Position>& positions, const std::vector<Velocity>& velocities) {
  State state;
  for (const Position& p : positions) state.positions.push_back(glm::dvec3(p.high) + glm::dvec3(p.low));
  for (const Velocity& v : velocities) state.velocities.push_back(glm::dvec3(v.high) + glm::dvec3(v.low));
  return state;
}

State read_state(const Sim& sim) {
  if (on_cpu(sim)) return sim.host;
  const KeepBindings kept;
  return state_of(sim.positions.read_all<Position>(), sim.velocities.read_all<Velocity>());
}

std::uint64_t state_hash(const Sim& sim) {
  const KeepBindings kept;
  std::uint64_t hash = fnv_basis;
  const auto add = [&](const glm::vec3& value) { hash = hash_values(std::span(&value.x, 3), hash); };
  for (const Position& p : sim.positions.read_all<Position>()) add(p.high), add(p.low);
  for (const Velocity& v : sim.velocities.read_all<Velocity>()) add(v.high), add(v.low);
  return hash;
}

// ---------------------------------------------------------------------------------------------------------
// pinning

namespace {

// A member of each vertex's record in a buffer of `Record`s.
template <class Record, class Value>
void write_vertices(Sim& sim, const Buffer& to, std::size_t member, const VertexList& vertices,
                    const std::vector<Value>& values) {
  if (vertices.empty()) return;
  std::vector<std::size_t> offsets;
  for (const std::uint32_t v : vertices) offsets.push_back(v * sizeof(Record) + member);
  to.write_each(offsets, sizeof(Value), values.data());
  sim.needs_predict = true;
}

void write_inverse_masses(Sim& sim, const VertexList& vertices) {
  std::vector<float> values;
  for (const std::uint32_t v : vertices) values.push_back(float(sim.inverse_masses[v]));
  write_vertices<Position>(sim, sim.positions, offsetof(Position, inverse_mass), vertices, values);
}

}  // namespace

void pin(Sim& sim, const VertexList& vertices) {
  const KeepBindings kept;
  for (const std::uint32_t v : vertices) {
    sim.inverse_masses[v] = 0;
    if (on_cpu(sim)) sim.host.velocities[v] = glm::dvec3(0);
  }
  write_inverse_masses(sim, vertices);
  write_vertices<Velocity>(sim, sim.velocities, 0, vertices, std::vector<Velocity>(vertices.size()));
}

void unpin(Sim& sim, const VertexList& vertices) {
  const KeepBindings kept;
  for (const std::uint32_t v : vertices) sim.inverse_masses[v] = sim.model->inverse_masses[v];
  write_inverse_masses(sim, vertices);
}

bool is_pinned(const Sim& sim, std::uint32_t vertex) { return !(sim.inverse_masses[vertex] > 0); }

void move_pinned(Sim& sim, const VertexList& vertices, const std::vector<glm::dvec3>& positions) {
  const KeepBindings kept;
  std::vector<Position> records;
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    const std::uint32_t v = vertices[i];
    records.push_back(to_gpu(positions[i], sim.inverse_masses[v], sim.system.at_vertex[v]));
    if (on_cpu(sim)) sim.host.positions[v] = positions[i];
  }
  write_vertices<Position>(sim, sim.positions, 0, vertices, records);
}

}  // namespace tetpbd
