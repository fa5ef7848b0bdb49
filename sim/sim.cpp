#include "sim/sim.h"

#include <fmt/format.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>
#include <span>
#include <tuple>

#include "sim/error.h"
#include "sim/hash.h"
#include "sim/material.h"
#include "sim/moving_shape.h"
#include "sim/parallel.h"
#include "sim/reference/leapfrog.h"
#include "sim/solvers/cpu_pbd.h"
#include "sim/solvers/substep.h"

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

// That is stable at rest, s; 0 but in mode explicit.
double longest_substep(const Sim& sim, const Settings& settings) {
  if (!leaps(settings)) return 0;
  return stable_step({*sim.model, sim.system, settings, sim.inverse_masses}, settings.compliance,
                     sim.model->rest.positions, 30);
}

// How many substeps of mode explicit stay stable, `stiffening` times as short as at rest.
int stable_substeps(const Settings& settings, double longest, double stiffening) {
  const double at_rest = longest > 0 ? settings.dt / (settings.stability * longest) : 0;
  constexpr double most = 100000;
  const double wanted = at_rest > most ? at_rest : std::min(at_rest * stiffening, most);
  if (wanted > most)
    throw Error("the body is too stiff for mode explicit",
                fmt::format("a step takes {:.3g} substeps", wanted),
                fmt::format("at most {:g}: use another mode, a softer material or a shorter dt", most));
  return int(std::ceil(wanted));
}

Plan planned(const Settings& settings, double longest, const Watch& watch) {
  Plan plan = plan_for(settings);
  if (leaps(settings))
    plan.substeps = std::max(plan.substeps, stable_substeps(settings, longest, watch.stiffening));
  plan.substeps *= watch.finer;
  plan.h = settings.dt / plan.substeps;
  return plan;
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
std::vector<RigidRecord> rigid_records(const Model& model) {
  std::vector<RigidRecord> records;
  for (const Body& body : model.bodies) {
    RigidRecord& record = records.emplace_back();
    record.first = unsigned(body.first_vertex), record.vertices = unsigned(body.vertices);
    record.one_piece = body.one_piece;
    const auto mass = model.masses.begin() + std::ptrdiff_t(body.first_vertex);
    record.mass = float(std::accumulate(mass, mass + std::ptrdiff_t(body.vertices), 0.0));
  }
  return records;
}

// What the driver allows, where nothing lower is asked for.
Tuning within_limits(Tuning tuning) {
  GLint row = 0;
  glGetIntegeri_v(GL_MAX_COMPUTE_WORK_GROUP_COUNT, 0, &row);
  if (tuning.lanes == 0) tuning.lanes = is_software_renderer() ? 1 : 8;  // there, one after the other
  if (tuning.lanes > 8 || !std::has_single_bit(tuning.lanes))
    throw Error("no such tuning", fmt::format("lanes={}", tuning.lanes), "a power of two up to 8");
  if (tuning.row == 0 || tuning.row > unsigned(row)) tuning.row = unsigned(row);
  GLint64 bytes = 0;
  glGetInteger64v(GL_MAX_SHADER_STORAGE_BLOCK_SIZE, &bytes);
  if (tuning.storage == 0 || tuning.storage > std::size_t(bytes)) tuning.storage = std::size_t(bytes);
  return tuning;
}

void schedule(Sim& sim) {
  if (!on_cpu(sim)) sim.substep = substep_dispatches(sim.solver, sim.plan.iterations);
}

// As kernels note it (project.glsl), in mode explicit.
double stiffest(const Sim& sim, const Settings& settings, const std::vector<glm::dvec3>& positions) {
  return leaps(settings) ? stiffest_constraint({*sim.model, sim.system, settings, sim.inverse_masses},
                                               settings.compliance, positions)
                         : 0;
}

// rad/s, of the body that spins the fastest.
double fastest_spin(const Model& model, const State& state) {
  double fastest = 0;
  for (const Body& body : model.bodies) {
    double mass = 0;
    glm::dvec3 centre(0), angular(0);
    glm::dmat3 inertia(0);
    const auto each = [&](auto&& f) {
      for (std::size_t i = body.first_vertex; i < body.first_vertex + body.vertices; ++i)
        f(model.masses[i], state.positions[i], state.velocities[i]);
    };
    each([&](double m, const glm::dvec3& x, const glm::dvec3&) { mass += m, centre += m * x; });
    each([&](double m, const glm::dvec3& x, const glm::dvec3& v) {
      const glm::dvec3 r = x - centre / mass;
      angular += m * glm::cross(r, v);
      inertia += m * (glm::dmat3(glm::dot(r, r)) - glm::outerProduct(r, r));
    });
    const double spin = glm::length(glm::inverse(inertia) * angular);
    if (std::isfinite(spin)) fastest = std::max(fastest, spin);
  }
  return fastest;
}

// Of a state that is given, before its first step.
void start_watch(Sim& sim, const State& state) {
  forget_answers(sim);
  Watch& w = sim.watch;
  const double at_rest = w.at_rest;
  const int finer = w.finer;
  static_cast<WatchNumbers&>(w) = {};
  w.at_rest = at_rest, w.finer = finer;
  if (is_implicit(sim.settings)) {
    const double turn = fastest_spin(*sim.model, state) * plan_for(sim.settings).h;
    set_finer(sim, turn > TURN_LIMIT ? finer_times : 1);
  }
  if (!(w.at_rest > 0)) return make_plan(sim);
  const double now = stiffest(sim, sim.settings, state.positions) / w.at_rest;
  w.stiffer = std::isfinite(now) ? now : 1;
  w.stiffening = stiffening_for(w.stiffer, sim.settings.stability);
  make_plan(sim);
}

SolverInput solver_input(const Sim& sim) {
  const Settings& s = sim.settings;
  return {*sim.model,
          sim.system,
          s,
          sim.plan,
          sim.tuning,
          is_software_renderer(),
          compliant(s),
          touches_rigidly(*sim.model, s),
          leaps(s)};
}

void renew(Sim& sim) {
  if (!sim.solver.renewed) return;
  Renewal& r = sim.renewal;
  r.again = r.words.valid();
  if (r.again) return;
  r.words = std::async(std::launch::async,
                       [model = sim.model, job = sim.solver.renewed(solver_input(sim))] { return job(); });
  r.steps = 8 + long(sim.model->rest.tets.size() / 1000);  // about as long as it takes, at real time
}

void take_renewal(Sim& sim) {
  const std::vector<glm::vec4> words = sim.renewal.words.get();
  const Buffer& to = sim.solver.buffers[sim.solver.renewable];
  to.write(0, to.bytes(), words.data());
  if (sim.renewal.again) renew(sim);
}

std::vector<int> first_values(const Model& model) {
  std::vector<int> first{0};
  for (const Obstacle& shape : model.shapes)
    first.push_back(first.back() + (shape.field ? int(shape.field->values.size()) : 0));
  return first;
}

void make_fields(Sim& sim) {
  std::vector<float> values;
  for (const Obstacle& shape : sim.model->shapes)
    if (shape.field) values.insert(values.end(), shape.field->values.begin(), shape.field->values.end());
  GLint most = 0;
  glGetIntegerv(GL_MAX_TEXTURE_BUFFER_SIZE, &most);
  if (values.size() > std::size_t(most))
    throw Error("the fields of obstacles are too large",
                fmt::format("{} values, the driver allows {}", values.size(), most),
                "give their meshes fewer voxels", 1);
  sim.fields = Buffer("fields of obstacles", values);
  sim.fields_texture = Texture("fields of obstacles", GL_TEXTURE_BUFFER);
  glTexBuffer(GL_TEXTURE_BUFFER, GL_R32F, sim.fields.id());
  glBindTexture(GL_TEXTURE_BUFFER, 0);
}

// Of a list of shapes: all reaches, then all shapes.
std::size_t shapes_bytes(const Sim& sim) {
  return sim.model->shapes.size() * (sizeof(glm::vec4) + sizeof(Shape));
}

// Bytes from one list of shapes to the next.
std::size_t shapes_stride(const Sim& sim) {
  GLint alignment = 256;
  glGetIntegerv(GL_UNIFORM_BUFFER_OFFSET_ALIGNMENT, &alignment);
  const std::size_t bytes = shapes_bytes(sim), unit = std::size_t(alignment);
  return (bytes + unit - 1) / unit * unit;
}

// How far from its centre it is met by what it carries on `times` its way over h, |way - h (v + w x arm)| <=
// |way| + h (|v| + |w| |arm|): |arm| (1 - times h |w|) <= radius + times h |v| + times |way|.
glm::vec4 reach_of(const MovingShape& shape, double h) {
  constexpr double times = 4;
  const double left = 1 - times * h * glm::length(shape.spin), size = glm::length(shape.pose.centre);
  const double reach = 1.01 * (shape.reach() + times * h * glm::length(shape.velocity)) / left + 1e-6 * size;
  return {glm::vec3(shape.pose.centre),
          left < 0.5 ? 1e18f : float(std::min(reach, 1e18))};  // squares are finite
}

Shape shape_block(const MovingShape& shape, int first) {
  const auto& s = shape.solid;
  Shape block{};
  split_pair(shape.pose.centre, block.centre, block.centre_low);
  block.right = glm::vec3(shape.pose.axes[0]), block.up = glm::vec3(shape.pose.axes[1]);
  block.front = glm::vec3(shape.pose.axes[2]);
  block.kind = s.kind, block.first = first, block.cells = s.cells;
  block.extent = glm::vec3(s.extent), block.origin = glm::vec3(s.origin);
  block.radius = float(s.radius), block.spacing = float(s.spacing), block.trust = float(s.trust);
  block.velocity = glm::vec3(shape.velocity), block.spin = glm::vec3(shape.spin);
  block.friction = float(shape.friction), block.restitution = float(shape.restitution);
  return block;
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
  if (has_fields(*sim.model)) make_fields(sim);
  sim.solver = find_solver_mode(settings.mode)->create(input);
  if (sim.solver.schedule)
    sim.predict = std::move(sim.solver.begin);
  else
    sim.predict = {Program::compute("predict.comp", {}, defines), work_groups(count, group_size),
                   count * (sizeof(Position) + sizeof(Velocity) + 16)};
  sim.longest_substep = longest_substep(sim, settings);
  make_plan(sim);
  sim.watch.at_rest = stiffest(sim, settings, sim.model->rest.positions);
  const auto buffer = [&](const char* label, std::size_t bytes) {
    check_storage(sim.tuning, label, bytes);
    return Buffer(label, bytes);
  };
  sim.step_block = Buffer("step", sizeof(Step));
  sim.positions = buffer("positions", count * sizeof(Position));
  sim.velocities = buffer("velocities", count * sizeof(Velocity));
  if (on_cpu(sim)) return sim;
  if (!sim.solver.schedule) {
    if (!leaps(settings)) sim.predicted = buffer("predicted", count * sizeof(Velocity));
    sim.quantized[0] = buffer("quantized positions", count * 16 * (input.compliant ? 2 : 1));
  }
  if (sim.solver.double_buffered)
    sim.quantized[1] = buffer("quantized positions, other side", sim.quantized[0].bytes());
  if (input.rigid) {
    sim.rigid_bodies =
        buffer("hard bodies", rigid_records(*sim.model).size() * sizeof(RigidRecord) + 8 * count);
    sim.rigid_contact = {Program::compute("rigid_contact.comp", {}, defines), work_groups(count, group_size),
                         4 * count};
  }
  if (bodies_touch(*sim.model, settings)) sim.pairs = make_pairs(*sim.model, settings, sim.tuning, defines);
  if (sim.tuning.count_guards) sim.guard_counts = Buffer("guard counts", GUARDS * sizeof(GLuint));
  sim.check.words = Buffer("check", 16);
  sim.check.read_back = Buffer("check read-back", 8, nullptr, GL_STREAM_READ);
  sim.check.copy = Program::compute("checkpoint.comp");
  if (leaps(settings) || is_implicit(settings)) {
    sim.watch.answer = Buffer("watch read-back", 8, nullptr, GL_STREAM_READ);
    sim.watch.nothing = Buffer("nothing", 8, std::array{0.0f, 1.0f}.data());
  }
  schedule(sim);
  return sim;
}

// What decides which constraints there are.
auto kinds_of(const Settings& s) {
  const bool dashpots = s.material == "neo-hookean";
  return std::tuple(kinds_in_use(s), s.material, s.young_modulus, s.poisson_ratio,
                    dashpots ? s.constraint_damping : 0);
}

// The constraints of other settings, if the solver needs only be told their numbers.
bool take_constraints(Sim& sim, const Settings& settings) {
  if (kinds_of(settings) == kinds_of(sim.settings)) return true;
  if (!sim.solver.take_numbers) return false;
  ConstraintSystem system = build_constraints(sim.model->rest, settings);
  const auto like = [](const ConstraintList& a, const ConstraintList& b) {
    return a.count() == b.count() && a.compliance.size() == b.compliance.size();
  };
  if (!std::ranges::equal(system.lists, sim.system.lists, like)) return false;
  sim.solver.take_numbers(sim.solver, system);
  sim.system = std::move(system);
  return true;
}

// Made whole beside the old one: no room, or a shader that does not compile, leaves that running.
void remake(Sim& sim, const Settings& settings) {
  if (check_finite(sim, true)) restore_checkpoint(sim);  // it has nothing better to start from
  State state = read_state(sim);
  Sim fresh =
      make_sim(sim.model, settings, sim.tuning,
               kinds_of(settings) == kinds_of(sim.settings) ? sim.system
                                                            : build_constraints(sim.model->rest, settings));
  fresh.inverse_masses = sim.inverse_masses;
  fresh.steps = sim.steps, fresh.origin = sim.origin;
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
  return is_implicit(settings) ? 0 : 0.5 * plan.h * settings.gravity;
}

Sim create_sim(std::shared_ptr<const Model> model, const Settings& settings, const Tuning& tuning) {
  check_settings(settings, "settings");
  if (model->obstacles.size() + 1 > MAX_PLANES)
    throw Error("too many obstacles", fmt::format("{} half spaces", model->obstacles.size()),
                fmt::format("at most {} beside the ground", MAX_PLANES - 1));
  if (model->shapes.size() > MAX_SHAPES)
    throw Error("too many obstacles", fmt::format("{} with a shape, or moving", model->shapes.size()),
                fmt::format("at most {}", MAX_SHAPES));
  ConstraintSystem system = build_constraints(model->rest, settings);
  Sim sim = make_sim(std::move(model), settings, tuning, std::move(system));
  reset(sim);
  return sim;
}

double explicit_substeps(const Model& model, const Settings& s) {
  const ConstraintSystem system = build_constraints(model.rest, s);
  const ReferenceInput input{model, system, s, model.inverse_masses};
  const double longest = stable_step(input, s.compliance, model.rest.positions, 12);
  return std::max(1.0, std::ceil(s.dt / (s.stability * longest)));
}

void make_plan(Sim& sim) { sim.plan = planned(sim.settings, sim.longest_substep, sim.watch); }

void write_step_block(Sim& sim, int substeps_before) {
  const Settings& s = sim.settings;
  const double h = sim.plan.h;
  const bool soft = compliant(s);
  Step block{};
  block.gravity = {0.0f, float(-s.gravity), 0.0f};
  block.h = float(h);
  block.inverse_h = float(1 / h);
  block.omega = soft ? 1.0f : float(s.omega);
  block.share = leaps(s) ? 0.0f : float(1 / s.omega);
  block.friction = float(s.friction);
  block.drag = float(s.damping);
  block.kick = substeps_before ? float(0.5 * (1 + double(sim.plan.substeps) / substeps_before)) : 1;
  block.restitution = float(s.restitution);
  block.body_size = float(sim.model->size);
  block.velocity_scale = float(std::exp(-s.damping * h));
  block.max_correction = float(longest_correction(*sim.model, s));
  block.correction_quantum = float(longest_correction(*sim.model, s) / double(1 << 30));
  block.mass_splitting = splits_masses(s);
  block.quantum = float(sim.quantum);
  block.inverse_quantum = float(1 / sim.quantum);
  block.quantized_size = float(sim.quantum / double(std::numeric_limits<float>::epsilon()));
  block.vertex_count = unsigned(sim.model->positions.size());
  block.damping = float(s.constraint_damping / h);
  block.turn_limit = float(TURN_LIMIT / sim.watch.finer);
  for (const glm::dvec4& plane : planes_of(*sim.model, s))
    block.planes[block.plane_count++] = glm::vec4(plane);
  for (std::size_t k = 0; k < kind_count; ++k) {
    block.stiffness[k / 4][glm::length_t(k % 4)] = float(s.stiffness[k]);
    block.compliance[k / 4][glm::length_t(k % 4)] = float(s.compliance[k] / (h * h));
  }
  sim.step_block.write(0, sizeof block, &block);
  write_shapes(sim);
  sim.needs_predict = true;  // the quantized positions hold a prediction with the old h and gravity
}

void forget_answers(Sim& sim) {
  sim.watch.asked = {};
  if (sim.watch.answer) sim.watch.nothing.copy_to(sim.check.words, 8, 0, 8);
}

void forget_contacts(Sim& sim) {
  if (!sim.rigid_bodies) return;
  const auto records = rigid_records(*sim.model);
  sim.rigid_bodies.write(0, records.size() * sizeof(RigidRecord), records.data());
}

void write_shapes(Sim& sim) {
  if (sim.model->shapes.empty()) return;
  const int substeps = on_cpu(sim) ? 0 : sim.plan.substeps;
  const double h = sim.plan.h;
  const auto lists = shapes_of(*sim.model, sim.settings, time_of(sim) - h, h, substeps + 1);
  const std::size_t stride = shapes_stride(sim);
  const std::vector<int> first = first_values(*sim.model);
  std::vector<char> bytes(lists.size() * stride);
  for (std::size_t l = 0; l < lists.size(); ++l)
    for (std::size_t k = 0; k < lists[l].size(); ++k) {
      const Shape block = shape_block(lists[l][k], first[k]);
      const glm::vec4 reach = reach_of(lists[l][k], h);
      const std::size_t at = l * stride + lists[l].size() * sizeof reach;
      std::memcpy(&bytes[l * stride + k * sizeof reach], &reach, sizeof reach);
      std::memcpy(&bytes[at + k * sizeof block], &block, sizeof block);
    }
  if (sim.shapes.bytes() == bytes.size())
    sim.shapes.write(0, bytes.size(), bytes.data());
  else
    sim.shapes = Buffer("shapes", bytes, GL_STREAM_DRAW);
  sim.shapes_now = 0;
}

void take_obstacles(Sim& sim, bool others) { others ? remake(sim, sim.settings) : write_step_block(sim); }

void bind_shapes(const Sim& sim, int list) {
  if (!sim.shapes) return;
  const std::size_t stride = shapes_stride(sim), lists = sim.shapes.bytes() / stride;
  glBindBufferRange(GL_UNIFORM_BUFFER, BIND_SHAPES, sim.shapes.id(),
                    GLintptr(std::min(std::size_t(list), lists - 1) * stride), GLsizeiptr(shapes_bytes(sim)));
  if (!sim.fields) return;
  glActiveTexture(GL_TEXTURE0 + UNIT_FIELDS);
  glBindTexture(GL_TEXTURE_BUFFER, sim.fields_texture.id());
  glActiveTexture(GL_TEXTURE0);
}

void reset(Sim& sim) {
  if (sim.guard_counts) sim.guard_counts.clear();
  sim.guards = {};
  sim.inverse_masses = sim.model->inverse_masses;
  finish_renewal(sim);
  forget_all(sim);
  start_with(sim, {sim.model->positions, sim.model->velocities}, 0);
}

void forget_all(Sim& sim) {
  static_cast<StepValues&>(sim) = {};
  static_cast<PairNumbers&>(sim.pairs) = {};
}

void start_with(Sim& sim, State state, double fall) {
  start_watch(sim, state);
  add_upwards(sim, state, half_substep_fall(sim.settings, sim.plan) - fall);
  write_state(sim, state);
}

Carried carried(Sim& sim) {
  Carried all;
  if (on_cpu(sim)) return all;
  all.add(sim.positions), all.add(sim.velocities);
  if (sim.quantized[0]) all.add(sim.quantized[sim.read_index]);
  if (sim.rigid_bodies) all.add(sim.rigid_bodies);
  for (const auto& [buffer, first, bytes] : sim.solver.handed_on)
    all.ranges.push_back({&sim.solver.buffers[buffer], first, bytes});
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

void write_state(Sim& sim, const State& state) {
  if (on_cpu(sim)) sim.host = state;
  upload(sim, state);
  sim.quantum = quantum_of(sim, state);
  write_step_block(sim);
  start_check(sim, &state);
  start_pairs(sim, state);
}

void apply_settings(Sim& sim, const Settings& settings) {
  check_settings(settings, "settings");
  const auto made_for = [&](const Settings& s) {
    return std::tuple(s.mode, compliant(s), touches_rigidly(*sim.model, s), s.contact);
  };
  const auto forces = [](const Settings& s) { return std::tuple(s.compliance, s.constraint_damping); };
  const auto renewed_for = [&](const Settings& s) {
    return std::tuple(kinds_of(s), forces(s), plan_for(s).h);
  };
  const Settings before = sim.settings;
  const double fall = half_substep_fall(before, sim.plan);
  if (settings.dt != before.dt) sim.origin = {sim.steps, time_of(sim)};
  const bool anew = made_for(settings) != made_for(before) || !take_constraints(sim, settings);
  if (anew) remake(sim, settings);
  const bool same = forces(settings) == forces(sim.settings);
  const double longest = same ? sim.longest_substep : longest_substep(sim, settings);
  const Plan plan = planned(settings, longest, sim.watch);
  if (!same) sim.watch.at_rest = stiffest(sim, settings, sim.model->rest.positions);
  sim.longest_substep = longest;
  forget_answers(sim);
  sim.settings = settings, sim.plan = plan;
  if (!anew && renewed_for(settings) != renewed_for(before)) renew(sim);
  schedule(sim);
  write_step_block(sim);
  if (!anew) retime_velocities(sim, fall);
}

void set_stiffening(Sim& sim, double stiffening) {
  const int before = sim.plan.substeps;
  sim.watch.stiffening = stiffening;
  make_plan(sim);
  if (sim.plan.substeps == before) return;
  sim.watch.changed = true;
  write_step_block(sim, before);
}

void refresh_preconditioner(Sim& sim) { renew(sim), finish_renewal(sim); }

void set_finer(Sim& sim, int times) {
  if (std::exchange(sim.watch.finer, times) == times) return;
  make_plan(sim);
  refresh_preconditioner(sim);
  write_step_block(sim);
}

void count_down_renewal(Sim& sim) {
  if (sim.renewal.words.valid() && --sim.renewal.steps == 0) take_renewal(sim);
}

void finish_renewal(Sim& sim) {
  while (sim.renewal.words.valid()) take_renewal(sim);
}

void rebuild_shaders(Sim& sim) { remake(sim, sim.settings); }

GuardCounts guard_counts(Sim& sim) {
  if (sim.guard_counts) {
    glMemoryBarrier(GL_ATOMIC_COUNTER_BARRIER_BIT);
    const auto now = sim.guard_counts.read_all<GLuint>();
    for (std::size_t g = 0; g < GUARDS; ++g) sim.guards[g] += now[g];
    sim.guard_counts.clear();
  }
  return sim.guards;
}

State state_of(const std::vector<Position>& positions, const std::vector<Velocity>& velocities) {
  State state;
  for (const Position& p : positions) state.positions.push_back(glm::dvec3(p.high) + glm::dvec3(p.low));
  for (const Velocity& v : velocities) state.velocities.push_back(glm::dvec3(v.high) + glm::dvec3(v.low));
  return state;
}

State read_state(const Sim& sim) {
  if (on_cpu(sim)) return sim.host;
  return state_of(sim.positions.read_all<Position>(), sim.velocities.read_all<Velocity>());
}

std::uint64_t state_hash(const Sim& sim) {
  std::uint64_t hash = fnv_basis;
  const auto add = [&](const glm::vec3& value) { hash = hash_values(std::span(&value.x, 3), hash); };
  for (const Position& p : sim.positions.read_all<Position>()) add(p.high), add(p.low);
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
  sim.needs_predict = true;
}

}  // namespace

void pin(Sim& sim, std::uint32_t vertex) {
  write_inverse_mass(sim, vertex, 0);
  const Velocity still{};
  sim.velocities.write(vertex * sizeof still, sizeof still, &still);
  if (on_cpu(sim)) sim.host.velocities[vertex] = glm::dvec3(0);
}

void unpin(Sim& sim, std::uint32_t vertex) {
  write_inverse_mass(sim, vertex, sim.model->inverse_masses[vertex]);
}

bool is_pinned(const Sim& sim, std::uint32_t vertex) { return !(sim.inverse_masses[vertex] > 0); }

void move_pinned(Sim& sim, std::uint32_t vertex, const glm::dvec3& position) {
  const Position p = to_gpu(position, sim.inverse_masses[vertex], sim.system.at_vertex[vertex]);
  sim.positions.write(vertex * sizeof(Position), sizeof p, &p);
  sim.needs_predict = true;
  if (on_cpu(sim)) sim.host.positions[vertex] = position;
}

}  // namespace tetpbd
