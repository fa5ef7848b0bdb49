#include "sim/metrics.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "shaders/metrics/layout.glsl"

namespace tetpbd {

namespace {

constexpr std::size_t ring_size = 16;

// Lists are sorted by vertex and bodies share none, so each body owns a range of each list.
Metrics::Range range_of(const ConstraintList& list, std::size_t first_vertex, std::size_t end_vertex) {
  const auto first_at_least = [&](std::size_t vertex) {
    std::size_t low = 0, high = list.count();
    while (low < high) {
      const std::size_t middle = (low + high) / 2;
      if (list.vertices[middle * std::size_t(list.arity)] < vertex)
        low = middle + 1;
      else
        high = middle;
    }
    return unsigned(low);
  };
  return {first_at_least(first_vertex), first_at_least(end_vertex)};
}

}  // namespace

Metrics create_metrics(const Model& model, const ConstraintSystem& made) {
  Metrics m;
  const auto is_made = [&](std::size_t k) { return k < made.present.size() && made.present[k]; };
  std::string missing;
  for (std::size_t k = 0; k < constraint_kinds().size(); ++k)
    if (!is_made(k)) missing += std::string(missing.empty() ? "" : ",") + constraint_kinds()[k].name;
  ConstraintSystem rest_of_kinds;
  if (!missing.empty()) rest_of_kinds = build_constraints(model.rest, missing);
  std::vector<const ConstraintList*> lists;
  std::vector<Buffer> records;
  // A mesh can lack hinges (no two surface triangles share an edge): keep an empty buffer for them.
  for (std::size_t k = 0; k < constraint_kinds().size(); ++k) {
    lists.push_back(is_made(k) ? &made.lists[k] : &rest_of_kinds.lists[k]);
    records.push_back(record_buffer(*lists[k], constraint_kinds()[k].name));
  }
  static_assert(std::is_same_v<std::tuple_element_t<0, Kinds>, Stretch> &&
                std::is_same_v<std::tuple_element_t<1, Kinds>, Bend> &&
                std::is_same_v<std::tuple_element_t<2, Kinds>, Volume>);
  m.stretch = std::move(records[0]);
  m.bend = std::move(records[1]);
  m.volume = std::move(records[2]);
  m.edge_count = lists[0]->count();
  m.hinge_count = lists[1]->count();
  m.tet_count = lists[2]->count();
  std::vector<glm::vec4> rest(model.rest.positions.size());
  const std::vector<double> volumes = tet_volumes(model.rest);
  for (const Body& body : model.bodies) {
    Metrics::BodyRanges ranges;
    const std::size_t end = body.first_vertex + body.vertices;
    ranges.vertices = {unsigned(body.first_vertex), unsigned(end)};
    ranges.edges = range_of(*lists[0], body.first_vertex, end);
    ranges.hinges = range_of(*lists[1], body.first_vertex, end);
    ranges.tets = {unsigned(body.first_tet), unsigned(body.first_tet + body.tets)};
    glm::dvec3 centre{0};
    std::vector<glm::dvec3> shape;
    for (std::size_t i = body.first_vertex; i < end; ++i) {
      ranges.mass += model.masses[i];
      centre += model.masses[i] * model.rest.positions[i];
      shape.push_back(model.rest.positions[i]);
    }
    centre /= ranges.mass;
    for (std::size_t i = body.first_vertex; i < end; ++i)
      rest[i] = glm::vec4(glm::vec3(model.rest.positions[i] - centre), float(model.masses[i]));
    for (std::size_t t = body.first_tet; t < body.first_tet + body.tets; ++t) ranges.volume += volumes[t];
    ranges.size = bounds(shape).size();
    m.bodies.push_back(ranges);
  }
  m.rest = Buffer("metrics rest", rest);
  m.partials = Buffer("metrics partials", M_ROW * METRICS_GROUPS * sizeof(float));
  for (std::size_t slot = 0; slot < ring_size; ++slot)
    m.rows.emplace_back("metrics row", model.bodies.size() * M_STRIDE * sizeof(float), nullptr,
                        GL_STREAM_READ);
  m.constraints = Program::compute("metrics/constraints.comp");
  m.vertices = Program::compute("metrics/vertices.comp");
  m.centre = Program::compute("metrics/centre.comp");
  m.rigid = Program::compute("metrics/rigid.comp");
  m.close = Program::compute("metrics/close.comp");
  return m;
}

namespace {

void dispatch(const Program& program, unsigned groups) {
  program.use();
  glDispatchCompute(groups, 1, 1);
  glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT);
}

Measurement read_row(const Metrics& m, const Metrics::Pending& pending) {
  std::vector<float> floats(m.bodies.size() * M_STRIDE);
  m.rows[pending.slot].read(0, floats.size() * sizeof(float), floats.data());
  Measurement result;
  result.step = pending.step;
  result.time = pending.time;
  double rest_volume = 0, mass = 0, tet_squares = 0, stretch_squares = 0, bend_squares = 0, rigid = 0,
         size = 0;
  const auto largest = [](double a, double b) { return std::isnan(b) ? b : std::max(a, b); };
  for (std::size_t b = 0; b < m.bodies.size(); ++b) {
    const Metrics::BodyRanges& body = m.bodies[b];
    const float* row = floats.data() + b * M_STRIDE;
    const auto vector = [&](int at) { return glm::dvec3(row[at], row[at + 1], row[at + 2]); };
    rest_volume += body.volume;
    mass += body.mass;
    result.volume += body.volume + double(row[M_VOLUME_CHANGE]);
    tet_squares += double(row[M_TET_SQUARES]);
    stretch_squares += double(row[M_STRETCH_SQUARES]);
    bend_squares += double(row[M_BEND_SQUARES]);
    result.tet_volume_max = largest(result.tet_volume_max, double(row[M_TET_MAX]));
    result.stretch_max = largest(result.stretch_max, double(row[M_STRETCH_MAX]));
    result.inverted_tets += double(row[M_INVERTED]);
    result.momentum += vector(M_MOMENTUM);
    result.angular_momentum += vector(M_ANGULAR);
    result.speed += double(row[M_SPEED]);
    result.centre += body.mass * (vector(M_ORIGIN) + vector(M_CENTRE));
    result.kinetic += double(row[M_KINETIC]);
    result.potential += pending.gravity * (double(row[M_HEIGHT]) - body.mass * pending.ground);
    result.contacts += double(row[M_CONTACTS]);
    result.non_finite += double(row[M_NON_FINITE]);
    rigid += double(row[M_RIGID_SQUARES]);
    size += body.mass * body.size;
  }
  const auto rms = [](double squares, std::size_t count) {
    return count ? std::sqrt(squares / double(count)) : 0.0;
  };
  result.centre /= mass;
  result.volume_error_percent = 100 * (result.volume - rest_volume) / rest_volume;
  result.tet_volume_rms = rms(tet_squares, m.tet_count);
  result.stretch_rms = rms(stretch_squares, m.edge_count);
  result.bend_rms_rad = rms(bend_squares, m.hinge_count);
  result.rigid_distance = std::sqrt(rigid / mass) / (size / mass);
  return result;
}

std::optional<Measurement> read_oldest(Metrics& m, bool wait) {
  if (m.pending.empty()) return std::nullopt;
  if (!reached(m.pending.front().fence.sync(), wait, "measuring")) return std::nullopt;
  const Metrics::Pending pending = std::move(m.pending.front());
  m.pending.pop_front();
  return read_row(m, pending);
}

}  // namespace

void measure(Metrics& m, const Sim& sim) {
  if (m.pending.size() == m.rows.size()) m.ready.push_back(*read_oldest(m, true));
  const std::size_t slot = m.next;
  m.next = (m.next + 1) % m.rows.size();
  sim.step_block.bind_uniform(BIND_STEP);
  sim.current_positions().bind_storage(BIND_M_POSITIONS);
  sim.velocities.bind_storage(BIND_M_VELOCITIES);
  m.rest.bind_storage(BIND_M_REST);
  m.stretch.bind_storage(BIND_M_STRETCH);
  m.bend.bind_storage(BIND_M_BEND);
  m.volume.bind_storage(BIND_M_VOLUME);
  m.partials.bind_storage(BIND_M_PARTIALS);
  for (std::size_t b = 0; b < m.bodies.size(); ++b) {
    const Metrics::BodyRanges& body = m.bodies[b];
    glBindBufferRange(GL_SHADER_STORAGE_BUFFER, BIND_M_ROW, m.rows[slot].id(),
                      GLintptr(b * M_STRIDE * sizeof(float)), M_STRIDE * sizeof(float));
    // About four tets an invocation before there are more groups.
    const unsigned groups = unsigned(std::min<std::size_t>(
        METRICS_GROUPS, work_groups(body.tets.end - body.tets.first, 4 * METRICS_SIZE)));
    for (const Program* program : {&m.constraints, &m.vertices, &m.rigid, &m.centre, &m.close}) {
      program->use();
      program->set("groups", groups);
    }
    for (const Program* program : {&m.vertices, &m.rigid, &m.centre}) {
      program->use();
      program->set("first_vertex", body.vertices.first);
    }
    for (const Program* program : {&m.vertices, &m.rigid}) {
      program->use();
      program->set("end_vertex", body.vertices.end);
    }
    for (const Program* program : {&m.rigid, &m.centre}) {
      program->use();
      program->set("mass", float(body.mass));
    }
    m.constraints.use();
    m.constraints.set("first_edge", body.edges.first), m.constraints.set("end_edge", body.edges.end);
    m.constraints.set("first_hinge", body.hinges.first), m.constraints.set("end_hinge", body.hinges.end);
    m.constraints.set("first_tet", body.tets.first), m.constraints.set("end_tet", body.tets.end);
    dispatch(m.constraints, groups);
    m.vertices.use();
    m.vertices.set("touching", float(1e-5 * body.size));
    dispatch(m.vertices, groups);
    dispatch(m.centre, 1);
    dispatch(m.rigid, groups);
    dispatch(m.close, 1);
  }
  m.pending.push_back({Fence::here(), slot, sim.steps, double(sim.steps) * sim.settings.dt,
                       sim.settings.ground ? sim.settings.ground_height : 0.0, sim.settings.gravity});
}

std::optional<Measurement> collect(Metrics& m, bool wait) {
  if (m.ready.empty()) return read_oldest(m, wait);
  const Measurement result = m.ready.front();
  m.ready.pop_front();
  return result;
}

Measurement measure_now(Metrics& m, const Sim& sim) {
  while (collect(m, true)) {
  }
  measure(m, sim);
  return *collect(m, true);
}

Measurement nothing_measured() {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  Measurement m;
  for (double* value : {&m.volume, &m.volume_error_percent, &m.tet_volume_rms, &m.tet_volume_max,
                        &m.inverted_tets, &m.stretch_rms, &m.stretch_max, &m.bend_rms_rad, &m.rigid_distance,
                        &m.speed, &m.kinetic, &m.potential, &m.contacts})
    *value = nan;
  m.momentum = m.angular_momentum = m.centre = glm::dvec3(nan);
  return m;
}

void add_measurement(RunErrors& errors, const Measurement& now, const Sim& sim) {
  errors.finite = errors.finite && now.finite();
  if (!errors.finite) return;  // numbers stay those of the last good state
  if (!errors.first) errors.first = now, errors.start_energy = errors.max_energy = now.energy();
  errors.last = now;
  errors.max_volume_loss_percent = std::max(errors.max_volume_loss_percent, -now.volume_error_percent);
  errors.max_energy = std::max(errors.max_energy, now.energy());
  double mass = 0;
  for (std::size_t i = 0; i < sim.inverse_masses.size(); ++i) {
    mass += sim.model->masses[i];
    if (!(sim.inverse_masses[i] > 0)) errors.free = false;
  }
  if (now.contacts > 0 || sim.settings.damping > 0) errors.free = false;
  if (!errors.free) return;
  const glm::dvec3 gravity(0, -sim.settings.gravity, 0);
  const glm::dvec3 expected = errors.first->momentum + mass * gravity * (now.time - errors.first->time);
  if (now.speed > 0)
    errors.linear_drift = std::fmax(errors.linear_drift, glm::length(now.momentum - expected) / now.speed);
  // Relative to the angular momentum of a spinning body; of one that hardly spins, to size times sum m|v|.
  const double spun = glm::length(errors.first->angular_momentum), moved = sim.model->size * now.speed;
  const double scale = spun > 0.01 * moved ? spun : moved;
  if (scale > 0)
    errors.angular_drift = std::fmax(
        errors.angular_drift, glm::length(now.angular_momentum - errors.first->angular_momentum) / scale);
}

}  // namespace tetpbd
