#include "sim/measure/metrics.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <ranges>

#include "shaders/measure/layout.glsl"
#include "sim/contact/moving_obstacle.h"
#include "sim/gl/keep_bindings.h"
#include "sim/model/material.h"
#include "sim/parallel.h"

namespace tetpbd {

namespace {

// The names of blocks of the kinds that are measured, in the order of the table.
constexpr std::array record_blocks = {"Stretch", "Bend", "Volume"};
constexpr std::size_t ring_size = 16, measured_kinds = std::tuple_size_v<decltype(Metrics::counts)>;
// Those that have an energy where no material has it: the measured ones, and isobend, whose hinges are those of bend.
constexpr std::array energy_kinds = {index_of<Stretch>, index_of<Bend>, index_of<Volume>, index_of<Isobend>};

// The constraints of a body. Lists are sorted by vertex and bodies share none, so they are a range of each list.
glm::uvec2 constraint_range(const ConstraintList& list, glm::uvec2 vertices) {
  const auto numbers = std::views::iota(0u, unsigned(list.count()));
  const auto first_vertex = [&](unsigned c) { return list.vertices[c * std::size_t(list.arity)]; };
  return {std::ranges::lower_bound(numbers, vertices.x, {}, first_vertex) - numbers.begin(),
          std::ranges::lower_bound(numbers, vertices.y, {}, first_vertex) - numbers.begin()};
}

Buffer tet_records(const ConstraintList& tets, const TetMesh& mesh) {
  std::vector<layout::TetRecord> records(tets.count());
  parallel_for(records.size(), [&](std::size_t t) {
    layout::TetRecord& record = records[t];
    std::ranges::copy(tets.ends(t), record.vertices);
    record.rest = float(tets.rest[t]), record.filled = float(tets.rest[t] * fill_of(mesh, t));
    record.mu = record.lambda = -1;
  });
  return Buffer("records volume", records);
}

// J over C^2 of energy_kinds, of a body without a material model; 0 where a kind has no energy.
glm::vec4 energy_per_square(const Material& material) {
  glm::vec4 factors(0);
  for (std::size_t k = 0; k < energy_kinds.size() && !has_energy(material); ++k) {
    const double compliance = material.compliance[std::size_t(energy_kinds[k])];
    if (uses(material, constraint_kinds[std::size_t(energy_kinds[k])]) && compliance > 0)
      factors[glm::length_t(k)] = float(0.5 / compliance);
  }
  return factors;
}

// Whether a body has all constraints of the kinds that are measured.
bool has_all(const ConstraintSystem& system, const Body& body) {
  for (std::size_t k = 0; k < measured_kinds; ++k) {
    const auto range = constraint_range(system.lists[k], {body.first_vertex, body.first_vertex + body.vertices});
    if (range.x == range.y && !(k == std::size_t(index_of<Volume>) && body.is_sheet())) return false;
  }
  return true;
}

// Gives tets of regions their moduli, of which the solver may hold a part only, where these have changed.
void write_regions(Metrics& m, const Sim& sim) {
  const auto& shares = sim.solver.stiffness_shares;
  if (sim.model->regions.empty() || (m.of_regions == sim.settings.bodies && m.shares == shares)) return;
  m.of_regions = sim.settings.bodies, m.shares = shares;
  std::vector<std::size_t> places;
  std::vector<glm::vec2> values;
  for (std::size_t t = 0; t < sim.model->regions.size(); ++t) {
    if (sim.model->regions[t] == 0) continue;
    const Lame moduli = tet_moduli(*sim.model, sim.settings, t);
    const double share = shares.empty() ? 1 : double(shares[body_at(*sim.model, sim.model->rest.tets[t][0]).number]);
    places.push_back(t * sizeof(layout::TetRecord) + offsetof(layout::TetRecord, mu));
    values.emplace_back(share * moduli.mu, share * moduli.lambda);
  }
  m.records[std::size_t(index_of<Volume>)].write_each(places, sizeof values[0], values.data());
}

// Makes the records of attachments and fibres anew where the simulation has others.
void write_held(Metrics& m, const Sim& sim) {
  if (sim.system.lists.empty()) return;  // a baseline has no constraints
  const auto& shares = sim.solver.stiffness_shares;
  const auto& attachments = sim.system.lists[index_of<Attach>].compliance;
  const auto& fibres = sim.system.lists[index_of<Fibre>].compliance;
  if (m.held.attachments == attachments && m.held.fibres == fibres && m.held.shares == shares) return;
  m.held.attachments = attachments, m.held.fibres = fibres, m.held.shares = shares;
  std::vector<layout::HeldRecord> records;
  for (const std::size_t kind : {index_of<Attach>, index_of<Fibre>})
    for (layout::HeldRecord& record : held_records(sim.system.lists[kind], kind == index_of<Fibre>)) {
      if (!shares.empty()) record.stiffness *= shares[body_at(*sim.model, record.vertices[0]).number];
      records.push_back(record);
    }
  m.held.count = records.size();
  if (records.empty()) return;
  m.held.records = Buffer("attachments and fibres", records);
  if (!m.held.pass) m.held.pass = {Program::compute("measure/held.comp"), 1};
}

// Reads a measurement back; false where it has not arrived yet.
bool read(const Metrics& m, Metrics::Pending& pending, bool wait) {
  if (!pending.fence.sync()) return true;
  if (!reached(pending.fence.sync(), wait, "measuring")) return false;
  pending.fence = {};
  Measurement& result = pending.result;
  const std::vector<float> rows = m.rows[pending.slot].read_all<float>();
  std::array<double, M_ROW> sums{};
  double heights = 0;  // kg m, midway
  const auto largest = [](double a, double b) { return std::isnan(b) ? b : std::max(a, b); };
  for (std::size_t b = 0; b < m.bodies.size(); ++b) {
    const float* row = rows.data() + b * M_STRIDE;
    for (std::size_t at = 0; at < M_ROW; ++at) sums[at] += double(row[at]);
    result.tet_volume_max = largest(result.tet_volume_max, double(row[M_TET_MAX]));
    result.penetration_max = largest(result.penetration_max, double(row[M_PENETRATION]) / m.bodies[b].size);
    result.stretch_max = largest(result.stretch_max, double(row[M_STRETCH_MAX]));
    const auto of_body = [&](std::size_t at) { return glm::dvec3(row[at], row[at + 1], row[at + 2]); };
    const glm::dvec3 centre = of_body(M_ORIGIN) + of_body(M_CENTRE);
    result.centre += m.bodies[b].mass * centre;
    // From the body's own sums: those of heights lose a body's bounces to what floats drop far from the ground.
    heights += m.bodies[b].mass * centre.y - pending.midway * double(row[M_MOMENTUM + 1]);
    result.angular_momentum += of_body(M_ANGULAR) + glm::cross(centre, of_body(M_MOMENTUM));
  }
  const auto rms = [](double squares, std::size_t count) { return count ? std::sqrt(squares / double(count)) : 0.0; };
  const auto vector = [&](std::size_t at) { return glm::dvec3(sums[at], sums[at + 1], sums[at + 2]); };
  double deeper = 0, most = m.vertices / 1000;
  for (int octaves = 0; octaves < DEPTHS && deeper <= most; ++octaves) {
    const double here = sums[std::size_t(M_DEPTHS + octaves)];
    if (deeper + here > most) result.penetration_999 = std::exp2(-0.5 * (octaves + (most - deeper) / here));
    deeper += here;
  }
  result.penetration_999 = std::min(result.penetration_999, result.penetration_max);
  if (!pending.obstacles) result.penetration_max = result.penetration_999 = std::nan("");
  result.volume = m.volume + sums[M_VOLUME_CHANGE];
  result.volume_error_percent = m.volume > 0 ? 100 * (result.volume - m.volume) / m.volume : 0;
  result.tet_volume_rms = rms(sums[M_TET_SQUARES], m.counts[2]);
  result.inverted_tets = sums[M_INVERTED];
  result.stretch_rms = rms(sums[M_STRETCH_SQUARES], m.counts[0]);
  result.bend_rms_rad = rms(sums[M_BEND_SQUARES], m.counts[1]);
  result.rigid_distance = std::sqrt(sums[M_RIGID_SQUARES] / m.mass) / (m.mass_sizes / m.mass);
  result.momentum = vector(M_MOMENTUM);
  result.speed = sums[M_SPEED];
  result.centre /= m.mass;
  result.angular_momentum -= glm::cross(result.centre, result.momentum);
  result.kinetic = sums[M_KINETIC];
  result.potential = pending.gravity * (sums[M_HEIGHT] - m.mass * pending.ground);
  result.elastic = sums[M_ELASTIC] + sums[M_AVERAGED] + (m.held.count > 0 ? double(rows[M_HELD]) : 0);
  result.stored =
      sums[M_ELASTIC_MIDWAY] + sums[M_AVERAGED_MIDWAY] + (m.held.count > 0 ? double(rows[M_HELD_MIDWAY]) : 0);
  result.total = result.kinetic + result.stored + pending.gravity * (heights - m.mass * pending.ground);
  result.work = sums[M_WORK];
  result.contacts = sums[M_CONTACTS];
  result.non_finite = sums[M_NON_FINITE];
  return true;
}

}  // namespace

Metrics create_metrics(const Model& model, const ConstraintSystem& made, const std::vector<double>& own_masses) {
  const KeepBindings kept;
  const std::vector<double>& masses = own_masses.empty() ? model.masses : own_masses;
  static_assert(index_of<Stretch> == 0 && index_of<Bend> == 1 && index_of<Volume> == 2);
  const bool all_made = made.present.size() >= measured_kinds &&
                        std::ranges::all_of(model.bodies, [&](const Body& body) { return has_all(made, body); });
  const ConstraintSystem own = all_made ? ConstraintSystem{} : build_constraints(model.rest, "stretch,bend,volume");
  const std::vector<ConstraintList>& lists = (all_made ? made : own).lists;
  Metrics m;
  for (std::size_t k = 0; k < measured_kinds; ++k) {
    m.records.push_back(k == std::size_t(index_of<Volume>) ? tet_records(lists[k], model.rest)
                                                           : record_buffer(lists[k], constraint_kinds[k].name));
    m.counts[k] = lists[k].count();
  }
  std::vector<glm::vec4> rest(model.rest.positions.size());
  const std::vector<double> volumes = tet_volumes(model.rest);
  for (const Body& body : model.bodies) {
    Metrics::BodyRanges ranges;
    const std::size_t first = body.first_vertex, end = first + body.vertices;
    ranges.vertices = {first, end};
    ranges.edges = constraint_range(lists[0], ranges.vertices);
    ranges.hinges = constraint_range(lists[1], ranges.vertices);
    ranges.tets = {body.first_tet, body.first_tet + body.tets};
    glm::dvec3 centre{0};
    for (std::size_t i = first; i < end; ++i) {
      ranges.mass += masses[i];
      centre += masses[i] * model.rest.positions[i];
    }
    centre /= ranges.mass;
    for (std::size_t i = first; i < end; ++i)
      rest[i] = glm::vec4(glm::vec3(model.rest.positions[i] - centre), float(masses[i]));
    for (std::size_t t = ranges.tets.x; t < ranges.tets.y; ++t) m.volume += volumes[t];
    ranges.size = body_bounds(body, model.rest.positions).size();
    m.mass += ranges.mass;
    m.mass_sizes += ranges.mass * ranges.size;
    m.bodies.push_back(ranges);
  }
  m.rest = Buffer("metrics rest", rest);
  m.partials = Buffer("metrics partials", std::vector<std::uint32_t>(1 + M_ROW * METRICS_GROUPS, 0));
  for (std::size_t slot = 0; slot < ring_size; ++slot)
    m.rows.emplace_back("metrics row", model.bodies.size() * M_STRIDE * sizeof(float), nullptr, GL_STREAM_READ);
  for (const char* name : {"sums", "rigid"})
    m.passes.push_back({Program::compute(fmt::format("measure/{}.comp", name), {}, obstacle_defines(model, false))});
  m.vertices = double(model.positions.size());
  return m;
}

void measure(Metrics& m, const Sim& sim, bool by_hand) {
  const KeepBindings kept;
  write_regions(m, sim), write_held(m, sim);
  if (m.pending.size() >= ring_size) read(m, m.pending[m.pending.size() - ring_size], true);
  const std::size_t slot = m.measured++ % ring_size;
  sim.step_block.bind_uniform(BIND_STEP);
  bind_obstacles(sim.obstacles);
  Recorder& recorder = m.recorder;
  recorder.begin();
  recorder.give("Positions", sim.positions), recorder.give("Velocities", sim.velocities);
  recorder.give("Rest", m.rest), recorder.give("Partials", m.partials);
  const double midway = solver_mode(sim.settings).implicit ? 0 : 0.5 * sim.plan.h;
  const auto& bindings = sim.solver.bindings;
  const auto rings = std::ranges::find(bindings, "Rings", &std::pair<std::string, GLuint>::first);
  if (rings != bindings.end()) {
    recorder.give("Rings", rings->second);
    // Beside the plain kernel, since a software renderer runs all that a kernel has.
    if (m.passes.size() == 2) m.passes.push_back({Program::compute("measure/rigid.comp", {}, {"AVERAGED 1"})});
  }
  for (std::size_t k = 0; k < m.records.size(); ++k) recorder.give(record_blocks[k], m.records[k]);
  Pass& of_sums = sim.yielding ? m.yielding : m.passes[0];
  if (sim.yielding) {
    std::vector<std::string> defines = obstacle_defines(*sim.model, false);
    defines.push_back("YIELDING 1");
    if (!of_sums) of_sums = {Program::compute("measure/sums.comp", {}, defines)};
    recorder.give("Volume", sim.yielding.records);
  }
  for (std::size_t b = 0; b < m.bodies.size(); ++b) {
    const Metrics::BodyRanges& body = m.bodies[b];
    recorder.give("Row", m.rows[slot].id(), b * M_STRIDE * sizeof(float), M_STRIDE * sizeof(float));
    const unsigned tets = body.tets.y - body.tets.x, items = tets > 0 ? tets : body.edges.y - body.edges.x;
    const unsigned groups = unsigned(std::clamp<std::size_t>(work_groups(items, METRICS_SIZE), 1, METRICS_GROUPS));
    const Program& sums = recorder.use(of_sums.program);
    sums.set("edge_range", body.edges), sums.set("hinge_range", body.hinges), sums.set("tet_range", body.tets);
    const Material material = solved_material(sim.model->bodies[b], sim.settings);
    const auto& shares = sim.solver.stiffness_shares;
    const float share = shares.empty() ? 1.0f : shares[b];  // what the solver holds it to have
    const glm::vec4 energies = glm::vec4(share, share, 1, 1) * energy_material(material);
    sums.set("material", energies);
    sums.set("energy_per_square", share * energy_per_square(material));
    sums.set("midway", float(midway)), sums.set("touching", float(1e-5 * body.size));
    const bool averaged = smoothed(material) && rings != bindings.end();
    for (const std::size_t number : {std::size_t(0), std::size_t(averaged ? 2 : 1)}) {
      Pass& pass = number == 0 ? of_sums : m.passes[number];
      const Program& kernel = recorder.use(pass.program);
      kernel.set("vertex_range", body.vertices), kernel.set("mass", float(body.mass));
      if (number == 2) kernel.set("material", energies), kernel.set("midway", float(midway));
      pass.work_groups = groups;
      recorder.run(pass, {{"groups", groups}});
    }
  }
  if (m.held.count > 0) {
    recorder.give("Held", m.held.records);
    recorder.give("Row", m.rows[slot].id(), 0, M_STRIDE * sizeof(float));
    recorder.use(m.held.pass.program).set("midway", float(midway));
    recorder.run(m.held.pass, {{"count", unsigned(m.held.count)}});
  }
  m.pending.push_back({Fence::here(),
                       slot,
                       {.step = sim.steps, .time = simulated_time(sim), .by_hand = by_hand},
                       sim.settings.ground ? sim.settings.ground_height : 0.0,
                       sim.settings.gravity,
                       midway,
                       has_obstacles(*sim.model, sim.settings)});
}

std::optional<Measurement> collect(Metrics& m, bool wait) {
  if (m.pending.empty()) return std::nullopt;
  const KeepBindings kept;
  if (!read(m, m.pending.front(), wait)) return std::nullopt;
  const Measurement result = m.pending.front().result;
  m.pending.pop_front();
  return result;
}

Measurement nothing_measured() {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  Measurement m;
  for (double* value :
       {&m.volume, &m.volume_error_percent, &m.tet_volume_rms, &m.tet_volume_max, &m.inverted_tets, &m.stretch_rms,
        &m.stretch_max, &m.bend_rms_rad, &m.rigid_distance, &m.speed, &m.kinetic, &m.potential, &m.elastic, &m.total,
        &m.stored, &m.contacts, &m.penetration_max, &m.penetration_999})
    *value = nan;
  m.momentum = m.angular_momentum = m.centre = glm::dvec3(nan);
  return m;
}

void add_measurement(RunErrors& errors, const Measurement& now, const Sim& sim) {
  errors.finite = errors.finite && now.finite();
  if (!errors.finite) return;  // the errors stay those of the last finite state
  if (!errors.first) errors.first = now, errors.start_energy = errors.max_energy = now.energy();
  errors.last = now;
  add_measurement(errors.ledger, now, *sim.model, sim.settings);
  errors.max_volume_loss_percent = std::max(errors.max_volume_loss_percent, -now.volume_error_percent);
  errors.max_energy = std::max(errors.max_energy, now.energy());
  errors.penetration_max = std::fmax(now.penetration_max, errors.penetration_max);
  errors.penetration_999 = std::fmax(now.penetration_999, errors.penetration_999);
  const auto is_fixed = [](double inverse_mass) { return !(inverse_mass > 0); };
  if (now.contacts > 0 || sim.settings.damping > 0 || !sim.model->loads.empty() ||
      std::ranges::any_of(sim.inverse_masses, is_fixed))
    errors.free = false;
  if (!errors.free) return;
  const double mass = std::accumulate(sim.masses.begin(), sim.masses.end(), 0.0);
  const glm::dvec3 gravity(0, -sim.settings.gravity, 0);
  const glm::dvec3 expected = errors.first->momentum + mass * gravity * (now.time - errors.first->time);
  if (now.speed > 0)
    errors.linear_drift = std::fmax(errors.linear_drift, glm::length(now.momentum - expected) / now.speed);
  // The drift is relative to the angular momentum, or of a body that hardly spins, to its size times sum m|v|.
  const double spun = glm::length(errors.first->angular_momentum), moved = sim.model->size * now.speed;
  const double scale = spun > 0.01 * moved ? spun : moved;
  if (scale > 0)
    errors.angular_drift =
        std::fmax(errors.angular_drift, glm::length(now.angular_momentum - errors.first->angular_momentum) / scale);
}

}  // namespace tetpbd
