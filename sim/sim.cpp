#include "sim/sim.h"

#include <fmt/format.h>

#include <cmath>
#include <cstring>

#include "sim/error.h"

namespace tetpbd {

namespace {

constexpr unsigned group_size = 256;  // of predict and finish

// Not inlined: GCC 12.2 at -O3 vectorises callers' loops and takes float(x) for x in the left-over elements,
// so that their low parts are lost (a test guards against it).
[[gnu::noinline]] void split_pair(const glm::dvec3& value, glm::vec3& high, glm::vec3& low) {
  for (int a = 0; a < 3; ++a) {
    const volatile float rounded = float(value[a]);
    high[a] = rounded;
    low[a] = float(value[a] - double(rounded));
  }
}

Position to_gpu(const glm::dvec3& x, double inverse_mass, std::uint32_t constraints) {
  Position p{};
  split_pair(x, p.high, p.low);
  p.inverse_mass = float(inverse_mass);
  p.constraints = float(constraints);
  return p;
}

void upload(Sim& sim, const State& state) {
  const std::size_t count = state.positions.size();
  std::vector<Position> positions(count);
  std::vector<Velocity> velocities(count);
  for (std::size_t i = 0; i < count; ++i) {
    positions[i] = to_gpu(state.positions[i], sim.inverse_masses[i], sim.system.at_vertex[i]);
    split_pair(state.velocities[i], velocities[i].high, velocities[i].low);
  }
  sim.positions[sim.current].write(0, count * sizeof(Position), positions.data());
  sim.velocities.write(0, count * sizeof(Velocity), velocities.data());
}

bool on_cpu(const Sim& sim) { return bool(sim.solver.step_on_cpu); }

void write_step_block(Sim& sim) {
  const Settings& s = sim.settings;
  const double h = s.dt / s.substeps;
  Step block{};
  block.gravity = {0.0f, float(-s.gravity), 0.0f};
  block.h = float(h);
  block.inverse_h = float(1 / h);
  block.omega = float(s.omega);
  block.friction = float(s.friction);
  block.keep = float(std::exp(-s.damping * h));
  block.limit = float(sim.model->size);
  block.delta_unit = float(sim.model->size / double(1 << 30));
  block.vertex_count = unsigned(sim.model->positions.size());
  if (s.ground) block.planes[block.plane_count++] = {0, 1, 0, float(s.ground_height)};
  for (const glm::dvec4& plane : sim.model->obstacles) block.planes[block.plane_count++] = glm::vec4(plane);
  for (std::size_t k = 0; k < constraint_kinds().size(); ++k)
    block.stiffness[k / 4][glm::length_t(k % 4)] = float(s.*constraint_kinds()[k].stiffness);
  sim.step_block.write(0, sizeof block, &block);
}

void build_solver(Sim& sim) {
  for (const SolverMode& mode : solver_modes())
    if (sim.settings.mode == mode.name) {
      // Made first, then put in place: a shader that does not compile leaves the old solver running.
      Pass predict, finish;
      predict.program = Program::compute("predict.comp");
      finish.program = Program::compute("finish.comp");
      predict.groups = finish.groups = work_groups(sim.model->positions.size(), group_size);
      predict.bytes = sim.model->positions.size() * (3 * sizeof(Position) + 2 * sizeof(Velocity));
      finish.bytes = sim.model->positions.size() * (2 * sizeof(Position) + 2 * sizeof(Velocity));
      finish.bindings = {{BIND_CHECK, sim.check.words.id()}};
      Program keep = Program::compute("keep.comp");
      Solver solver = mode.create({*sim.model, sim.system, is_software_renderer(), bool(sim.guard_counts)});
      const Limits limits = gl_limits();
      check_work_groups(predict.program.label(), predict.groups, limits);
      for (const Pass& pass : solver.iteration) check_work_groups(pass.program.label(), pass.groups, limits);
      sim.predict = std::move(predict);
      sim.finish = std::move(finish);
      sim.check.keep = std::move(keep);
      sim.solver = std::move(solver);
      sim.shader_version = shader_folder_version();
      return;
    }
  throw Error("no such mode", sim.settings.mode, "see tetpbd run --help");
}

// Positions of a double-buffered solver and of pins need inverse masses and counts in both buffers.
void write_both(Sim& sim, const State& state) {
  for (int b = 0; b < 2; ++b) {
    if (!sim.positions[b]) continue;
    sim.current = b;
    upload(sim, state);
  }
  sim.current = 0;
}

void allocate(Sim& sim) {
  const std::size_t count = sim.model->positions.size();
  sim.positions[0] = Buffer("positions 0", count * sizeof(Position));
  sim.positions[1] = sim.solver.double_buffered ? Buffer("positions 1", count * sizeof(Position)) : Buffer();
  sim.velocities = Buffer("velocities", count * sizeof(Velocity));
  sim.predicted = on_cpu(sim) ? Buffer() : Buffer("predicted", count * sizeof(Position));
}

State start_state(const Sim& sim) {
  State state{sim.model->positions, sim.model->velocities};
  // Semi-implicit Euler started half a substep back is leapfrog: velocities are those of mid-substep, and a
  // constant acceleration is integrated exactly (method.md eq. 3).
  const double half = 0.5 * sim.settings.dt / sim.settings.substeps;
  for (std::size_t i = 0; i < state.velocities.size(); ++i)
    if (sim.model->inverse_masses[i] > 0) state.velocities[i].y += half * sim.settings.gravity;
  return state;
}

void dispatch(const Pass& pass) {
  pass.program.use();
  for (const auto& [binding, buffer] : pass.bindings)
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, GLuint(binding), buffer);
  glDispatchCompute(pass.groups, 1, 1);
  glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT);
}

// Everything but the state.
Sim make_sim(std::shared_ptr<const Model> model, const Settings& settings, ConstraintSystem system,
             bool count_guards) {
  Sim sim;
  sim.model = std::move(model);
  sim.settings = settings;
  sim.inverse_masses = sim.model->inverse_masses;
  sim.system = std::move(system);
  check_limits(sim.system, gl_limits());
  make_check_words(sim.check);
  if (count_guards) sim.guard_counts = Buffer("guard counts", GUARDS * sizeof(GLuint));
  build_solver(sim);
  allocate(sim);
  make_kept(sim);
  sim.step_block = Buffer("step", sizeof(Step));
  write_step_block(sim);
  return sim;
}

double half_substep_fall(const Settings& s) { return 0.5 * s.dt / s.substeps * s.gravity; }

// Stored velocities are half a substep old (start_state): with another substep or gravity they are those of
// another time.
void shift_velocities(Sim& sim, double upwards) {
  if (upwards == 0) return;
  const auto moved = [&](std::size_t i) { return sim.inverse_masses[i] > 0; };
  if (on_cpu(sim)) {
    for (std::size_t i = 0; i < sim.host.velocities.size(); ++i)
      if (moved(i)) sim.host.velocities[i].y += upwards;
  }
  auto velocities = sim.velocities.read_all<Velocity>();
  for (std::size_t i = 0; i < velocities.size(); ++i) {
    Velocity& v = velocities[i];
    if (moved(i))
      split_pair(glm::dvec3(v.high) + glm::dvec3(v.low) + glm::dvec3(0, upwards, 0), v.high, v.low);
  }
  sim.velocities.write(0, velocities.size() * sizeof(Velocity), velocities.data());
}

}  // namespace

void check_limits(const ConstraintSystem& system, const Limits& limits) {
  const int needed = BIND_RECORDS + int(kind_words(system).size());
  if (needed > limits.storage_blocks)
    throw Error("too few shader storage blocks",
                fmt::format("{} needed, the driver offers {}", needed, limits.storage_blocks),
                "leave out a constraint kind or use a newer driver", 1);
  std::size_t largest = system.at_vertex.size() * sizeof(Position);
  for (const ConstraintList& list : system.lists)
    largest = std::max(largest, list.count() * std::size_t(list.arity + 1) * 4);
  if (largest > std::size_t(limits.storage_bytes))
    throw Error("a storage buffer is too large",
                fmt::format("{} bytes, the driver allows {}", largest, limits.storage_bytes),
                "use a smaller mesh", 1);
}

Sim create_sim(std::shared_ptr<const Model> model, const Settings& settings, bool count_guards) {
  if (model->obstacles.size() + 1 > MAX_PLANES)
    throw Error("too many obstacles", fmt::format("{} planes", model->obstacles.size()),
                fmt::format("at most {} beside the ground", MAX_PLANES - 1));
  ConstraintSystem system = build_constraints(model->rest, settings.constraints);
  Sim sim = make_sim(std::move(model), settings, std::move(system), count_guards);
  reset(sim);
  return sim;
}

void reset(Sim& sim) {
  sim.steps = 0;
  if (sim.guard_counts) sim.guard_counts.clear();
  sim.guards_read = on_cpu(sim) ? sim.solver.guards_on_cpu() : GuardCounts{};
  sim.inverse_masses = sim.model->inverse_masses;
  write_state(sim, start_state(sim));
}

void write_state(Sim& sim, const State& state) {
  if (on_cpu(sim)) sim.host = state;
  write_both(sim, state);
  start_check(sim, state);
}

void apply_settings(Sim& sim, const Settings& settings) {
  const bool kinds = settings.constraints != sim.settings.constraints;
  const double upwards = half_substep_fall(settings) - half_substep_fall(sim.settings);
  if (kinds || settings.mode != sim.settings.mode) {
    if (check_finite(sim, true)) return_to_kept(sim);  // a solver made anew has nothing better to start from
    const State state = read_state(sim);
    // Made whole beside the old one: no room, or a shader that does not compile, leaves that running.
    Sim fresh = make_sim(sim.model, settings,
                         kinds ? build_constraints(sim.model->rest, settings.constraints) : sim.system,
                         bool(sim.guard_counts));
    fresh.inverse_masses = sim.inverse_masses;
    fresh.steps = sim.steps;
    fresh.timed = sim.timed;
    write_state(fresh, state);
    sim = std::move(fresh);
  }
  sim.settings = settings;
  write_step_block(sim);
  shift_velocities(sim, upwards);
}

void rebuild_shaders(Sim& sim) {
  sim.shader_version = shader_folder_version();
  build_solver(sim);
  sim.check.reloaded = sim.steps;
}

void step(Sim& sim) {
  const Settings& s = sim.settings;
  if (on_cpu(sim)) {
    sim.solver.step_on_cpu(sim.host, s, sim.inverse_masses);
    upload(sim, sim.host);
    ++sim.steps;
    check_step(sim);
    return;
  }
  if (sim.guard_counts) {
    // Counters have 32 bits: read before they can wrap.
    const double a_step = 4.0 * double(sim.system.count()) * s.iterations * s.substeps;
    if (sim.steps % std::max(1L, long(2e9 / std::max(a_step, 1.0))) == 0) guard_counts(sim);
    glBindBufferBase(GL_ATOMIC_COUNTER_BUFFER, BIND_GUARDS, sim.guard_counts.id());
  }
  if (sim.timed) sim.timer.begin();
  sim.step_block.bind_uniform(BIND_STEP);
  sim.predicted.bind_storage(BIND_PREDICTED);
  sim.velocities.bind_storage(BIND_VELOCITIES);
  sim.finish.program.use();
  sim.finish.program.set("step_slot", check_slot(sim.steps + 1));
  glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT);  // a picture may still be drawn from what this overwrites
  for (int substep = 0; substep < s.substeps; ++substep) {
    sim.positions[sim.current].bind_storage(BIND_POSITIONS);
    dispatch(sim.predict);
    for (int iteration = 0; iteration < s.iterations; ++iteration) {
      sim.positions[sim.current].bind_storage(BIND_POSITIONS);
      if (sim.solver.double_buffered) sim.positions[1 - sim.current].bind_storage(BIND_POSITIONS_OUT);
      for (const Pass& pass : sim.solver.iteration) dispatch(pass);
      if (sim.solver.double_buffered) sim.current = 1 - sim.current;
    }
    sim.positions[sim.current].bind_storage(BIND_POSITIONS);
    dispatch(sim.finish);
  }
  if (sim.timed) sim.timer.end();
  // Whoever reads positions next may be a vertex fetch or a copy.
  glMemoryBarrier(GL_VERTEX_ATTRIB_ARRAY_BARRIER_BIT | GL_BUFFER_UPDATE_BARRIER_BIT);
  ++sim.steps;
  check_step(sim);
}

GuardCounts guard_counts(Sim& sim) {
  GuardCounts counts{};
  if (on_cpu(sim)) {
    counts = sim.solver.guards_on_cpu();
    for (std::size_t g = 0; g < GUARDS; ++g) counts[g] -= sim.guards_read[g];
  } else if (sim.guard_counts) {
    glMemoryBarrier(GL_ATOMIC_COUNTER_BARRIER_BIT);
    const auto now = sim.guard_counts.read_all<GLuint>();
    for (std::size_t g = 0; g < GUARDS; ++g) counts[g] = sim.guards_read[g] += now[g];
    sim.guard_counts.clear();
  }
  return counts;
}

State read_state(const Sim& sim) {
  if (on_cpu(sim)) return sim.host;
  const auto positions = sim.current_positions().read_all<Position>();
  const auto velocities = sim.velocities.read_all<Velocity>();
  State state;
  for (const Position& p : positions) state.positions.push_back(glm::dvec3(p.high) + glm::dvec3(p.low));
  for (const Velocity& v : velocities) state.velocities.push_back(glm::dvec3(v.high) + glm::dvec3(v.low));
  return state;
}

std::uint64_t state_hash(const Sim& sim) {
  std::uint64_t hash = 14695981039346656037ull;
  const auto add = [&](const glm::vec3& value) {
    unsigned char bytes[12];
    std::memcpy(bytes, &value, sizeof bytes);
    for (unsigned char byte : bytes) hash = (hash ^ byte) * 1099511628211ull;
  };
  for (const Position& p : sim.current_positions().read_all<Position>()) add(p.high), add(p.low);
  for (const Velocity& v : sim.velocities.read_all<Velocity>()) add(v.high), add(v.low);
  return hash;
}

// ---------------------------------------------------------------------------------------------------------
// pinning

namespace {

void write_inverse_mass(Sim& sim, std::uint32_t vertex, double value) {
  sim.inverse_masses[vertex] = value;
  const float inverse_mass = float(value);
  for (const Buffer& buffer : sim.positions)
    if (buffer)
      buffer.write(vertex * sizeof(Position) + offsetof(Position, inverse_mass), sizeof(float),
                   &inverse_mass);
}

void write_velocity(Sim& sim, std::uint32_t vertex, const glm::dvec3& velocity) {
  Velocity v{};
  split_pair(velocity, v.high, v.low);
  sim.velocities.write(vertex * sizeof(Velocity), sizeof v, &v);
  if (on_cpu(sim)) sim.host.velocities[vertex] = velocity;
}

}  // namespace

void pin(Sim& sim, std::uint32_t vertex) {
  write_inverse_mass(sim, vertex, 0);
  write_velocity(sim, vertex, glm::dvec3(0));
}

void unpin(Sim& sim, std::uint32_t vertex) {
  write_inverse_mass(sim, vertex, sim.model->inverse_masses[vertex]);
}

bool is_pinned(const Sim& sim, std::uint32_t vertex) { return !(sim.inverse_masses[vertex] > 0); }

void move_pinned(Sim& sim, std::uint32_t vertex, const glm::dvec3& position) {
  const Position p = to_gpu(position, sim.inverse_masses[vertex], sim.system.at_vertex[vertex]);
  sim.positions[sim.current].write(vertex * sizeof(Position), sizeof p, &p);
  if (on_cpu(sim)) sim.host.positions[vertex] = position;
}

// -------------------------------------------------------------------------------------------------------
// explanation

Explanation explain(const Sim& sim) {
  Explanation result;
  const auto add = [&](const Buffer& buffer) {
    if (!buffer) return;
    result.buffers.push_back({buffer.label(), buffer.bytes()});
    result.bytes += buffer.bytes();
  };
  for (const Buffer& buffer : sim.positions) add(buffer);
  add(sim.predicted);
  add(sim.velocities);
  add(sim.step_block);
  add(sim.guard_counts);
  for (const Buffer* buffer :
       {&sim.check.words, &sim.check.read_back, &sim.check.positions, &sim.check.velocities})
    add(*buffer);
  for (const Buffer& buffer : sim.solver.buffers) add(buffer);
  if (!on_cpu(sim)) {
    const long substeps = sim.settings.substeps;
    result.dispatches.push_back(
        {sim.predict.program.label(), sim.predict.groups, substeps, sim.predict.bytes});
    for (const Pass& pass : sim.solver.iteration)
      result.dispatches.push_back(
          {pass.program.label(), pass.groups, substeps * sim.settings.iterations, pass.bytes});
    result.dispatches.push_back({sim.finish.program.label(), sim.finish.groups, substeps, sim.finish.bytes});
  }
  for (const auto& dispatch : result.dispatches) {
    result.dispatches_per_step += dispatch.per_step;
    result.bytes_per_step += dispatch.bytes * std::size_t(dispatch.per_step);
  }
  return result;
}

}  // namespace tetpbd
