#include "sim/sim.h"

#include <fmt/format.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <mutex>

#include "sim/solvers/cpu_pbd.h"
#include "sim/error.h"
#include "sim/parallel.h"

namespace tetpbd {

namespace {

constexpr unsigned group_size = 256;  // of predict

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
  parallel_for(count, [&](std::size_t first, std::size_t end) {
    for (std::size_t i = first; i < end; ++i) {
      positions[i] = to_gpu(state.positions[i], sim.inverse_masses[i], sim.system.at_vertex[i]);
      split_pair(state.velocities[i], velocities[i].high, velocities[i].low);
    }
  });
  sim.positions.write(0, count * sizeof(Position), positions.data());
  sim.velocities.write(0, count * sizeof(Velocity), velocities.data());
  sim.stale = true;
}

bool has_handles(const Sim& sim) { return !sim.solver.handles.handles.empty(); }

// Poses near to the state's, and sums of 0; from there on the GPU keeps them.
void start_handles(Sim& sim, const State& state) {
  if (!has_handles(sim)) return;
  const std::vector<HandlePose> poses = handle_poses(sim.solver.handles, state.positions);
  std::vector<std::uint32_t> words(3 * HANDLE_ROW * poses.size());
  for (std::size_t h = 0; h < poses.size(); ++h) {
    std::uint32_t* row = words.data() + (sim.turn * poses.size() + h) * HANDLE_ROW;
    const glm::mat3 R(poses[h].R);
    std::memcpy(row + 36, &R, sizeof R);
    for (int a = 0; a < 3; ++a) {
      const double units = std::round(poses[h].place[a] / sim.unit);
      const double rest = std::isfinite(units) ? std::fmod(units, 4294967296.0) : 0;
      row[45 + a] = std::uint32_t(std::int64_t(rest));
    }
  }
  for (const auto& [binding, id] : sim.solver.bindings)
    if (binding == BIND_HANDLE_SUMS)
      for (const Buffer& buffer : sim.solver.buffers)
        if (buffer.id() == id) buffer.write(0, buffer.bytes(), words.data());
}

void write_step_block(Sim& sim) {
  const Settings& s = sim.settings;
  const double h = s.dt / s.substeps;
  Step block{};
  block.gravity = {0.0f, float(-s.gravity), 0.0f};
  block.h = float(h);
  block.inverse_h = float(1 / h);
  block.handles = float(has_handles(sim) ? s.handles : 0);
  block.omega = sim.solver.compliant ? 1.0f : float(relaxation(s.omega, has_handles(sim) ? s.handles : 0));
  block.friction = float(s.friction);
  block.keep = float(std::exp(-s.damping * h));
  block.limit = float(longest_correction(*sim.model, s));
  block.delta_unit = float(longest_correction(*sim.model, s) / double(1 << 30));
  // With averages, a constraint's multiplier would not be what its vertices were moved by.
  block.mass_splitting = (s.mass_splitting || sim.solver.compliant) && s.mode != "groups";
  block.unit = float(sim.unit);
  block.inverse_unit = float(1 / sim.unit);
  block.position_grain = float(sim.unit / double(std::numeric_limits<float>::epsilon()));
  block.vertex_count = unsigned(sim.model->positions.size());
  if (s.ground) block.planes[block.plane_count++] = {0, 1, 0, float(s.ground_height)};
  for (const glm::dvec4& plane : sim.model->obstacles) block.planes[block.plane_count++] = glm::vec4(plane);
  for (std::size_t k = 0; k < constraint_kinds().size(); ++k)
    block.stiffness[k / 4][glm::length_t(k % 4)] = float(s.*constraint_kinds()[k].stiffness);
  for (std::size_t k = 0; k < constraint_kinds().size(); ++k)
    block.softness[k / 4][glm::length_t(k % 4)] = float(s.*constraint_kinds()[k].compliance / (h * h));
  block.relaxation = {s.constraint_damping / h, s.omega, 0, 0};
  sim.step_block.write(0, sizeof block, &block);
  sim.stale = true;  // the places hold a prediction with the old h and gravity
}

// The unit of places: a power of two, so that multiplying by it is exact, and small, with room for vertices
// of a constraint 16 sizes apart (of the largest body, or of what the state stretches most). Everything that
// is computed from places is blurred by it.
double unit_of(const Sim& sim, const State& state) {
  double reach = sim.model->size;
  std::mutex taking;
  for (const ConstraintList& list : sim.system.lists)
    parallel_for(list.count(), [&](std::size_t first, std::size_t end) {
      double largest = 0;
      const std::size_t arity = std::size_t(list.arity);
      for (std::size_t c = first * arity; c < end * arity; c += arity)
        for (std::size_t j = 1; j < arity; ++j) {
          const double apart =
              glm::length(state.positions[list.vertices[c + j]] - state.positions[list.vertices[c]]);
          if (apart > largest && std::isfinite(apart)) largest = apart;
        }
      const std::lock_guard lock(taking);
      reach = std::max(reach, largest);
    });
  return std::exp2(std::ceil(std::log2(reach)) - 27);
}

// What the driver allows, where nothing lower is asked for.
Tuning within_limits(Tuning tuning) {
  GLint row = 0;
  glGetIntegeri_v(GL_MAX_COMPUTE_WORK_GROUP_COUNT, 0, &row);
  if (tuning.row == 0 || tuning.row > unsigned(row)) tuning.row = unsigned(row);
  GLint64 bytes = 0;
  glGetInteger64v(GL_MAX_SHADER_STORAGE_BLOCK_SIZE, &bytes);
  if (tuning.storage == 0 || tuning.storage > std::size_t(bytes)) tuning.storage = std::size_t(bytes);
  return tuning;
}

void build_solver(Sim& sim) {
  const SolverMode* mode = find_solver_mode(sim.settings.mode);
  if (!mode) throw Error("no such mode", sim.settings.mode, "see tetpbd run --help");
  // Made first, then put in place: a shader that does not compile leaves the old solver running.
  const std::size_t vertices = sim.model->positions.size();
  const bool soft = compliant(sim.settings), slow = damped(sim.settings);
  check_limits(sim.system, capabilities(), soft, wants_handles(sim.settings));
  Pass predict{Program::compute("predict.comp", {}, compliance_defines(soft, slow)),
               work_groups(vertices, group_size), vertices * (sizeof(Position) + sizeof(Velocity) + 16)};
  Solver solver = mode->create({*sim.model, sim.system, is_software_renderer(), sim.tuning,
                                sim.settings.groups, soft, slow, wants_handles(sim.settings)});
  solver.compliant = soft, solver.damped = slow;
  Program keep = Program::compute("keep.comp");
  sim.predict = std::move(predict);
  sim.check.keep = std::move(keep);
  sim.solver = std::move(solver);
  sim.stale = true;
  sim.shader_version = shader_folder_version();
}

void allocate(Sim& sim) {
  const std::size_t count = sim.model->positions.size();
  const auto buffer = [&](const char* label, std::size_t bytes) {
    check_storage(sim.tuning, label, bytes);
    return Buffer(label, bytes);
  };
  sim.positions = buffer("positions", count * sizeof(Position));
  sim.velocities = buffer("velocities", count * sizeof(Velocity));
  sim.predicted = on_cpu(sim) ? Buffer() : buffer("predicted", count * sizeof(Velocity));
  for (int side = 0; side < 2; ++side)
    sim.places[side] =
        on_cpu(sim) || (side == 1 && !sim.solver.double_buffered)
            ? Buffer()
            : buffer(side == 0 ? "places" : "places, other side", count * 16 * (sim.solver.damped ? 2 : 1));
  sim.side = 0;
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

// A step's dispatches one after the other. Whatever does not change from one to the next is not set again: at
// a few microseconds a dispatch, every call counts.
struct Dispatcher {
  const Tuning& tuning;
  GLuint program = 0;
  // `barriers`: who reads what it wrote, beside the next dispatch.
  void run(Pass& pass, const glm::uvec2& turn, GLbitfield barriers = 0) {
    if (pass.program.id() != program) pass.program.use(), program = pass.program.id();
    if (pass.turn != turn) pass.program.set(0, turn), pass.turn = turn;
    const std::size_t row = std::min<std::size_t>(pass.groups, tuning.row);
    glDispatchCompute(GLuint(row), GLuint((pass.groups + row - 1) / row), 1);
    glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT | barriers);
  }
};

// Everything but the state.
Sim make_sim(std::shared_ptr<const Model> model, const Settings& settings, const Tuning& tuning,
             ConstraintSystem system) {
  Sim sim;
  sim.model = std::move(model);
  sim.settings = settings;
  sim.tuning = within_limits(tuning);
  sim.inverse_masses = sim.model->inverse_masses;
  sim.system = std::move(system);
  make_check_words(sim.check);
  if (tuning.count_guards) sim.guard_counts = Buffer("guard counts", GUARDS * sizeof(GLuint));
  build_solver(sim);
  allocate(sim);
  make_kept(sim);
  sim.step_block = Buffer("step", sizeof(Step));
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

void check_limits(const ConstraintSystem& system, const Capabilities& limits, bool compliant, bool handles) {
  const int needed = std::max(handles ? STORAGE_BINDINGS_HANDLES : STORAGE_BINDINGS + int(compliant),
                              BIND_RECORDS + int(kind_words(system).size()));
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

Sim create_sim(std::shared_ptr<const Model> model, const Settings& settings, const Tuning& tuning) {
  if (model->obstacles.size() + 1 > MAX_PLANES)
    throw Error("too many obstacles", fmt::format("{} planes", model->obstacles.size()),
                fmt::format("at most {} beside the ground", MAX_PLANES - 1));
  ConstraintSystem system = build_constraints(model->rest, settings.constraints);
  Sim sim = make_sim(std::move(model), settings, tuning, std::move(system));
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
  upload(sim, state);
  sim.unit = unit_of(sim, state);
  start_handles(sim, state);
  write_step_block(sim);
  start_check(sim, state);
}

void apply_settings(Sim& sim, const Settings& settings) {
  const bool kinds = settings.constraints != sim.settings.constraints;
  const double upwards = half_substep_fall(settings) - half_substep_fall(sim.settings);
  const bool groups = settings.groups != sim.settings.groups && settings.mode == "groups";
  const bool softness =
      !on_cpu(sim) && (compliant(settings) != sim.solver.compliant || damped(settings) != sim.solver.damped);
  const bool handles = wants_handles(settings) != wants_handles(sim.settings);
  if (kinds || groups || softness || handles || settings.mode != sim.settings.mode) {
    if (check_finite(sim, true)) return_to_kept(sim);  // a solver made anew has nothing better to start from
    const State state = read_state(sim);
    // Made whole beside the old one: no room, or a shader that does not compile, leaves that running.
    Sim fresh = make_sim(sim.model, settings, sim.tuning,
                         kinds ? build_constraints(sim.model->rest, settings.constraints) : sim.system);
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
  start_handles(sim, read_state(sim));
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
  sim.positions.bind_storage(BIND_POSITIONS);
  sim.velocities.bind_storage(BIND_VELOCITIES);
  glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT);  // a picture may still be drawn from what this overwrites
  sim.predicted.bind_storage(BIND_PREDICTED);
  sim.check.words.bind_storage(BIND_CHECK);
  for (const auto& [binding, buffer] : sim.solver.bindings)
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, GLuint(binding), buffer);
  Dispatcher dispatcher{sim.tuning};
  const auto turn = [&](unsigned phase) {
    if (has_handles(sim)) phase |= sim.turn << TURN_BITS;
    return glm::uvec2(phase, phase & PHASE_FINISH ? check_slot(sim.steps + 1) : 0);
  };
  const auto bind_places = [&] {  // read these, write the others
    sim.places[sim.side].bind_storage(BIND_PLACES);
    sim.places[sim.solver.double_buffered ? 1 - sim.side : 0].bind_storage(BIND_PLACES_OUT);
  };
  Pass& move = sim.solver.iteration.back();
  // The last dispatch of all is read by vertex fetches and copies.
  const auto move_vertices = [&](unsigned phase, bool last) {
    const GLbitfield readers = GL_VERTEX_ATTRIB_ARRAY_BARRIER_BIT | GL_BUFFER_UPDATE_BARRIER_BIT;
    dispatcher.run(move, turn(phase), last ? readers : 0);
    if (sim.solver.double_buffered) sim.side = 1 - sim.side, bind_places();
    sim.turn = (sim.turn + 1) % 3;
  };
  if (sim.stale) {
    sim.places[sim.side].bind_storage(BIND_PLACES_OUT);
    dispatcher.run(sim.predict, {0, 0});
  }
  bind_places();
  if (sim.stale && has_handles(sim)) move_vertices(PHASE_PLACES, false);
  sim.stale = false;
  const bool separate = sim.solver.separate || s.iterations == 0;
  for (int substep = 0; substep < s.substeps; ++substep) {
    const bool end = substep + 1 == s.substeps;
    if (separate) move_vertices(PHASE_PREDICT, false);
    for (int iteration = 0; iteration < s.iterations; ++iteration) {
      unsigned solve = PHASE_SOLVE;
      if (sim.solver.compliant && iteration == 0) solve |= PHASE_FIRST;
      if (sim.solver.compliant && iteration + 1 == s.iterations) solve |= PHASE_LAST;
      for (std::size_t p = 0; p + 1 < sim.solver.iteration.size(); ++p)
        dispatcher.run(sim.solver.iteration[p], turn(solve));
      for (int group = 0; group < sim.solver.groups; ++group) {
        const bool last = group + 1 == sim.solver.groups, finish = last && iteration + 1 == s.iterations;
        unsigned phase = solve | unsigned(group) << PHASE_BITS;
        if (!separate && iteration == 0 && group == 0) phase |= PHASE_PREDICT;
        if (!separate && finish) phase |= PHASE_FINISH;
        if (last) phase |= PHASE_CONTACT;
        move_vertices(phase, end && !separate && finish);
      }
    }
    if (separate) move_vertices(PHASE_FINISH, end);
  }
  if (sim.timed) sim.timer.end();
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

State read_state(const Buffer& positions, const Buffer& velocities) {
  State state;
  for (const Position& p : positions.read_all<Position>())
    state.positions.push_back(glm::dvec3(p.high) + glm::dvec3(p.low));
  for (const Velocity& v : velocities.read_all<Velocity>())
    state.velocities.push_back(glm::dvec3(v.high) + glm::dvec3(v.low));
  return state;
}

State read_state(const Sim& sim) {
  return on_cpu(sim) ? sim.host : read_state(sim.current_positions(), sim.velocities);
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
  sim.positions.write(vertex * sizeof(Position) + offsetof(Position, inverse_mass), sizeof(float),
                      &inverse_mass);
  sim.stale = true;
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
  sim.positions.write(vertex * sizeof(Position), sizeof p, &p);
  sim.stale = true;
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
  for (const Buffer* buffer : {&sim.positions, &sim.velocities, &sim.predicted, &sim.places[0],
                               &sim.places[1], &sim.step_block, &sim.guard_counts, &sim.check.words,
                               &sim.check.read_back, &sim.check.positions, &sim.check.velocities})
    add(*buffer);
  for (const Buffer& buffer : sim.solver.buffers) add(buffer);
  if (!on_cpu(sim)) {
    const long substeps = sim.settings.substeps, iterations = sim.settings.iterations;
    const std::size_t vertices = sim.model->positions.size();
    const bool separate = sim.solver.separate || iterations == 0;
    const auto dispatch = [&](const Pass& pass, const char* what, long per_step, std::size_t more) {
      result.dispatches.push_back({pass.program.label() + what, pass.groups, per_step, pass.bytes + more});
    };
    dispatch(sim.predict, "", 0, 0);
    for (const Pass& pass : sim.solver.iteration) {
      const bool moves = &pass == &sim.solver.iteration.back();
      const long runs = moves ? iterations * sim.solver.groups : iterations;
      // The first and the last of a substep also read or write velocities and predicted positions.
      const long ends = moves && !separate ? (runs == 1 ? 1 : 2) : 0;
      const std::size_t more = runs == 1 ? 2 * sizeof(Velocity) : 3 * sizeof(Velocity);
      dispatch(pass, "", substeps * (runs - ends), 0);
      if (ends > 0)
        dispatch(pass, ends == 1 ? ", whole substep" : ", first and last", substeps * ends, vertices * more);
      if (moves && separate)
        dispatch(pass, ", before and after", 2 * substeps, vertices * 3 * sizeof(Velocity));
    }
    std::erase_if(result.dispatches, [&](const Explanation::Dispatch& d) {
      return d.per_step == 0 && d.name != sim.predict.program.label();
    });
  }
  for (const auto& dispatch : result.dispatches) {
    result.dispatches_per_step += dispatch.per_step;
    result.bytes_per_step += dispatch.bytes * std::size_t(dispatch.per_step);
  }
  return result;
}

}  // namespace tetpbd
