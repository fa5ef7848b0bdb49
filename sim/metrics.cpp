#include "sim/metrics.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <ranges>

#include "shaders/metrics/layout.glsl"

namespace tetpbd {

namespace {

constexpr std::size_t ring_size = 16;

// Lists are sorted by vertex and bodies share none, so each body owns a range of each list.
glm::uvec2 range_of(const ConstraintList& list, glm::uvec2 vertices) {
  const auto numbers = std::views::iota(0u, unsigned(list.count()));
  const auto first_vertex = [&](unsigned c) { return list.vertices[c * std::size_t(list.arity)]; };
  return {std::ranges::lower_bound(numbers, vertices.x, {}, first_vertex) - numbers.begin(),
          std::ranges::lower_bound(numbers, vertices.y, {}, first_vertex) - numbers.begin()};
}

}  // namespace

Metrics create_metrics(const Model& model, const ConstraintSystem& made) {
  // Those that are measured, as the bindings; further kinds have no measure.
  static_assert(index_of<Stretch> == 0 && index_of<Bend> == 1 && index_of<Volume> == 2);
  constexpr int measured = 3;
  Metrics m;
  std::string missing;
  const auto is_made = [&](int k) {
    return std::size_t(k) < made.present.size() && made.present[std::size_t(k)];
  };
  for_each_kind([&](auto kind, int k) {
    if (k < measured && !is_made(k)) missing += std::string(kind.row.name) + ",";
  });
  ConstraintSystem others;
  if (!missing.empty()) others = build_constraints(model.rest, missing.substr(0, missing.size() - 1));
  std::vector<const ConstraintList*> lists;
  for_each_kind([&](auto kind, int k) {
    if (k >= measured) return;
    lists.push_back(&(is_made(k) ? made : others).lists[std::size_t(k)]);
    // A mesh can lack hinges (no two surface triangles share an edge): an empty buffer then.
    m.records.push_back(record_buffer(*lists.back(), kind.row.name));
  });
  std::vector<glm::vec4> rest(model.rest.positions.size());
  const std::vector<double> volumes = tet_volumes(model.rest);
  for (const Body& body : model.bodies) {
    Metrics::BodyRanges ranges;
    const std::size_t first = body.first_vertex, end = first + body.vertices;
    ranges.vertices = {first, end};
    ranges.edges = range_of(*lists[0], ranges.vertices);
    ranges.hinges = range_of(*lists[1], ranges.vertices);
    ranges.tets = {body.first_tet, body.first_tet + body.tets};
    glm::dvec3 centre{0};
    for (std::size_t i = first; i < end; ++i) {
      ranges.mass += model.masses[i];
      centre += model.masses[i] * model.rest.positions[i];
    }
    centre /= ranges.mass;
    for (std::size_t i = first; i < end; ++i)
      rest[i] = glm::vec4(glm::vec3(model.rest.positions[i] - centre), float(model.masses[i]));
    for (std::size_t t = ranges.tets.x; t < ranges.tets.y; ++t) ranges.volume += volumes[t];
    const auto shape = model.rest.positions.begin();
    ranges.size = bounds({shape + std::ptrdiff_t(first), shape + std::ptrdiff_t(end)}).size();
    m.bodies.push_back(ranges);
  }
  m.rest = Buffer("metrics rest", rest);
  m.partials = Buffer("metrics partials", M_ROW * METRICS_GROUPS * sizeof(float));
  for (std::size_t slot = 0; slot < ring_size; ++slot)
    m.rows.emplace_back("metrics row", model.bodies.size() * M_STRIDE * sizeof(float), nullptr,
                        GL_STREAM_READ);
  for (const char* name : {"constraints", "vertices", "centre", "rigid", "close"})
    m.kernels.push_back(Program::compute(fmt::format("metrics/{}.comp", name)));
  return m;
}

namespace {

Measurement read_row(const Metrics& m, const Metrics::Pending& pending) {
  std::vector<float> floats(m.bodies.size() * M_STRIDE);
  m.rows[pending.slot].read(0, floats.size() * sizeof(float), floats.data());
  Measurement result = pending.known;
  double rest_volume = 0, mass = 0, tet_squares = 0, stretch_squares = 0, bend_squares = 0, rigid = 0,
         size = 0;
  std::size_t tets = 0, edges = 0, hinges = 0;
  const auto largest = [](double a, double b) { return std::isnan(b) ? b : std::max(a, b); };
  for (std::size_t b = 0; b < m.bodies.size(); ++b) {
    const Metrics::BodyRanges& body = m.bodies[b];
    const float* row = floats.data() + b * M_STRIDE;
    const auto vector = [&](int at) { return glm::dvec3(row[at], row[at + 1], row[at + 2]); };
    tets += body.tets.y - body.tets.x;
    edges += body.edges.y - body.edges.x;
    hinges += body.hinges.y - body.hinges.x;
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
  result.tet_volume_rms = rms(tet_squares, tets);
  result.stretch_rms = rms(stretch_squares, edges);
  result.bend_rms_rad = rms(bend_squares, hinges);
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
  for (std::size_t k = 0; k < m.records.size(); ++k) m.records[k].bind_storage(BIND_M_STRETCH + int(k));
  m.partials.bind_storage(BIND_M_PARTIALS);
  for (std::size_t b = 0; b < m.bodies.size(); ++b) {
    const Metrics::BodyRanges& body = m.bodies[b];
    glBindBufferRange(GL_SHADER_STORAGE_BUFFER, BIND_M_ROW, m.rows[slot].id(),
                      GLintptr(b * M_STRIDE * sizeof(float)), M_STRIDE * sizeof(float));
    // About four tets per invocation before there are more groups.
    const unsigned groups = unsigned(
        std::min<std::size_t>(METRICS_GROUPS, work_groups(body.tets.y - body.tets.x, 4 * METRICS_SIZE)));
    for (const Program& kernel : m.kernels) {
      kernel.use();
      kernel.set("groups", groups);
      kernel.set("vertex_range", body.vertices);
      kernel.set("edge_range", body.edges), kernel.set("hinge_range", body.hinges);
      kernel.set("tet_range", body.tets);
      kernel.set("mass", float(body.mass));
      kernel.set("touching", float(1e-5 * body.size));
      const bool one_group =
          &kernel == &m.kernels[2] || &kernel == &m.kernels[4];  // these add the groups' sums
      glDispatchCompute(one_group ? 1 : groups, 1, 1);
      // The next kernel reads these sums; the next body's first overwrites what this body's last read.
      glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT);
    }
  }
  Measurement known;
  known.step = sim.steps, known.time = double(sim.steps) * sim.settings.dt;
  m.pending.push_back({Fence::here(), slot, known, sim.settings.ground ? sim.settings.ground_height : 0.0,
                       sim.settings.gravity});
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
