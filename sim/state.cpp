// The state of a simulation: its positions and velocities to and from the GPU, and pinned vertices.
#include <span>

#include "sim/gl/keep_bindings.h"
#include "sim/hash.h"
#include "sim/parallel.h"
#include "sim/sim.h"

namespace tetpbd {

// Not inlined, because GCC 12.2 at -O3 vectorises callers' loops and takes float(x) for x in the left-over elements,
// whose low parts are then lost (a test guards against it).
[[gnu::noinline]] void split_double_single(const glm::dvec3& value, glm::vec3& high, glm::vec3& low) {
  for (int a = 0; a < 3; ++a) {
    const volatile float rounded = float(value[a]);
    high[a] = rounded;
    low[a] = float(value[a] - double(rounded));
  }
}

namespace {

Position to_gpu(const Sim& sim, std::size_t vertex, const glm::dvec3& x) {
  Position p{};
  split_double_single(x, p.high, p.low);
  p.inverse_mass = float(sim.inverse_masses[vertex]);
  p.constraints = float(sim.system.at_vertex[vertex]);
  return p;
}

// Writes the member at byte `member` of each vertex's Record.
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

std::vector<Velocity> read_velocities(const Sim& sim) {
  std::vector<Velocity> velocities(sim.masses.size());
  sim.velocities.read(0, velocities.size() * sizeof(Velocity), velocities.data());
  return velocities;
}

}  // namespace

void write_velocities(const Sim& sim, const State& state) {
  std::vector<Velocity> velocities(state.velocities.size());
  parallel_for(velocities.size(), [&](std::size_t i) {
    split_double_single(state.velocities[i], velocities[i].high, velocities[i].low);
    velocities[i].work = state.work.empty() ? 0 : float(state.work[i]);
  });
  sim.velocities.write(0, velocities.size() * sizeof(Velocity), velocities.data());
}

void upload(Sim& sim, const State& state) {
  std::vector<Position> positions(state.positions.size());
  parallel_for(positions.size(), [&](std::size_t i) { positions[i] = to_gpu(sim, i, state.positions[i]); });
  sim.positions.write(0, positions.size() * sizeof(Position), positions.data());
  write_velocities(sim, state);
  write_rest_metrics(sim, state.rest_metrics);
  sim.needs_predict = true;
}

State make_state(const std::vector<Position>& positions, const std::vector<Velocity>& velocities) {
  State state;
  for (const Position& p : positions) state.positions.push_back(glm::dvec3(p.high) + glm::dvec3(p.low));
  for (const Velocity& v : velocities) state.velocities.push_back(glm::dvec3(v.high) + glm::dvec3(v.low));
  if (std::ranges::any_of(velocities, [](const Velocity& v) { return v.work != 0; }))
    for (const Velocity& v : velocities) state.work.push_back(double(v.work));
  return state;
}

State read_state(const Sim& sim) {
  if (on_cpu(sim)) return sim.host;
  const KeepBindings kept;
  State state = make_state(sim.positions.read_all<Position>(), read_velocities(sim));
  if (sim.yielding) state.rest_metrics = rest_metrics_in(sim.yielding.records, 0, sim.model->rest.tets.size());
  return state;
}

std::uint64_t state_hash(const Sim& sim) {
  const KeepBindings kept;
  std::uint64_t hash = fnv_basis;
  const auto add = [&](const glm::vec3& value) { hash = hash_values(std::span(&value.x, 3), hash); };
  for (const Position& p : sim.positions.read_all<Position>()) add(p.high), add(p.low);
  for (const Velocity& v : read_velocities(sim)) add(v.high), add(v.low);
  return hash;
}

void pin(Sim& sim, const VertexList& vertices) {
  const KeepBindings kept;
  for (const std::uint32_t v : vertices) {
    sim.inverse_masses[v] = 0;
    if (on_cpu(sim)) sim.host.velocities[v] = glm::dvec3(0);
  }
  write_inverse_masses(sim, vertices);
  std::vector<std::size_t> parts;  // not of the work that stands between them
  for (const std::uint32_t v : vertices)
    for (const std::size_t part : {offsetof(Velocity, high), offsetof(Velocity, low)})
      parts.push_back(v * sizeof(Velocity) + part);
  if (!parts.empty()) sim.velocities.write_each(parts, sizeof(glm::vec3), std::vector<glm::vec3>(parts.size()).data());
}

void unpin(Sim& sim, const VertexList& vertices) {
  const KeepBindings kept;
  for (const std::uint32_t v : vertices) sim.inverse_masses[v] = free_inverse_mass(sim, v);
  write_inverse_masses(sim, vertices);
}

double free_inverse_mass(const Sim& sim, std::size_t vertex) {
  return sim.model->inverse_masses[vertex] > 0 ? 1 / sim.masses[vertex] : 0;
}

bool is_pinned(const Sim& sim, std::uint32_t vertex) { return !(sim.inverse_masses[vertex] > 0); }

}  // namespace tetpbd
