#include "sim/yielding.h"

#include <cmath>

#include "sim/model/material.h"
#include "sim/parallel.h"
#include "sim/sim.h"

namespace tetpbd {

namespace {

constexpr std::size_t numbers = std::extent_v<decltype(layout::YieldRecord::metric)>;

std::vector<layout::YieldRecord> records_at_start(const SolverInput& input) {
  const Model& model = input.model;
  std::vector<layout::YieldRecord> records(model.rest.tets.size());
  parallel_for(records.size(), [&](std::size_t t) {
    layout::YieldRecord& record = records[t];
    const Tet& tet = model.rest.tets[t];
    std::ranges::copy(tet, record.vertices);
    const double volume = tet_volume(model.rest, tet);
    record.rest = float(volume), record.filled = float(volume * fill_of(model.rest, t));
    record.mu = record.lambda = -1;
    glm::dvec3 x[4];
    for (std::size_t j = 0; j < 4; ++j) x[j] = model.rest.positions[tet[j]];
    const auto rest = NeoHookean::rest(x);
    for (std::size_t k = 0; k < numbers; ++k) record.metric[k] = float(rest[k]);
    const Material& own = material_of(input.settings, body_at(model, tet[0]).number);
    record.yield_strain = float(own.yield_strain), record.creep_time = float(own.creep_time);
    record.first_copy = record.end_copy = 0;
  });
  return records;
}

std::vector<double> metrics_in(const std::vector<layout::YieldRecord>& records) {
  std::vector<double> metrics;
  metrics.reserve(numbers * records.size());
  for (const layout::YieldRecord& record : records)
    metrics.insert(metrics.end(), std::begin(record.metric), std::end(record.metric));
  return metrics;
}

void flow_on_cpu(Sim& sim) {
  const std::vector<layout::YieldRecord>& tets = sim.yielding.at_start;
  std::vector<double>& metrics = sim.host.rest_metrics;
  parallel_for(tets.size(), [&](std::size_t t) {
    const layout::YieldRecord& tet = tets[t];
    glm::dvec3 x[4];
    for (std::size_t j = 0; j < 4; ++j) x[j] = sim.host.positions[tet.vertices[j]];
    const double kept = tet.creep_time > 0 ? std::exp(-sim.settings.dt / double(tet.creep_time)) : 0;
    const auto flowed =
        Formulas<double>{}.yielded(x, &metrics[numbers * t], 6 * double(tet.rest), double(tet.yield_strain), kept);
    std::ranges::copy(flowed.values, &metrics[numbers * t]);
  });
}

// On the GPU: `flows` 0 copies the metrics alone.
void run_pass(Sim& sim, unsigned flows) {
  Yielding& y = sim.yielding;
  const auto block =
      std::ranges::find(sim.solver.bindings, sim.solver.rest_block, &std::pair<std::string, GLuint>::first);
  sim.recorder.give("YieldRecords", y.records), sim.recorder.give("YieldCopies", y.copies);
  sim.recorder.give("RestValues", block->second);
  sim.recorder.use(y.pass.program).set("dt", float(sim.settings.dt));
  sim.recorder.run(y.pass, {{"count", unsigned(y.at_start.size())}, {"flows", flows}});
}

}  // namespace

void put_rest_metrics(ConstraintList& tets, const TetMesh& mesh, const std::vector<double>& metrics) {
  const auto of = find_tets(mesh, tets.count(), [&](std::size_t c) { return tets.ends(c); });
  for (std::size_t c = 0; c < of.size(); ++c)
    std::copy_n(&metrics[numbers * of[c]], numbers, &tets.rest[NeoHookean::row.values * c]);
}

Yielding make_yielding(const SolverInput& input, const Solver& solver) {
  Yielding y;
  if (!any_material(input.settings, yields) || input.model.rest.tets.empty()) return y;
  y.at_start = records_at_start(input);
  const ConstraintList& list = input.system.lists[index_of<NeoHookean>];
  const auto of = find_tets(input.model.rest, list.count(), [&](std::size_t c) { return list.ends(c); });
  const Grouped copies = group_by_key(solver.rest_copies.size(), y.at_start.size(), [&](std::size_t k, auto&& emit) {
    emit(of[solver.rest_copies[k][0]], solver.rest_copies[k][1]);
  });
  for (std::size_t t = 0; t < y.at_start.size(); ++t)
    y.at_start[t].first_copy = copies.first[t], y.at_start[t].end_copy = copies.first[t + 1];
  const std::size_t bytes = y.at_start.size() * sizeof(layout::YieldRecord);
  check_storage(input.tuning, "tets that yield", bytes);
  y.records = Buffer("tets that yield", y.at_start);
  if (solver_mode(input.settings).cpu) return y;
  y.copies = Buffer("copies of rest metrics", copies.values);
  y.pass = {Program::compute("yield.comp"), work_groups(y.at_start.size(), 128),
            bytes + copies.values.size() * (numbers + 1) * sizeof(float)};
  return y;
}

void flow(Sim& sim) {
  if (!sim.yielding) return;
  on_cpu(sim) ? flow_on_cpu(sim) : run_pass(sim, 1);
}

void copy_rest_metrics(Sim& sim) {
  if (!sim.yielding || std::exchange(sim.yielding.copied, true)) return;
  run_pass(sim, 0);
}

void write_rest_metrics(Sim& sim, const std::vector<double>& metrics) {
  if (!sim.yielding) return;
  std::vector<layout::YieldRecord> records = sim.yielding.at_start;
  for (std::size_t k = 0; k < metrics.size(); ++k) records[k / numbers].metric[k % numbers] = float(metrics[k]);
  sim.yielding.records.write(0, records.size() * sizeof records[0], records.data());
  sim.yielding.copied = false;
  if (on_cpu(sim) && sim.host.rest_metrics.empty()) sim.host.rest_metrics = metrics_in(records);
}

std::vector<double> rest_metrics_in(const Buffer& from, std::size_t at, std::size_t tets) {
  std::vector<layout::YieldRecord> records(tets);
  from.read(at, tets * sizeof records[0], records.data());
  return metrics_in(records);
}

}  // namespace tetpbd
