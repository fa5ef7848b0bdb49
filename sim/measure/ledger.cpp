#include "sim/measure/ledger.h"

#include <algorithm>
#include <cmath>

#include "sim/measure/metrics.h"
#include "sim/model/material.h"
#include "sim/solvers/solver.h"

namespace tetpbd {

namespace {

// J that gravity and the material can supply at most, beside what is there: the fall of all bodies to the ground, or by
// their own size; without gravity a strain of a thousandth.
double reserve(const Model& model, const Settings& settings) {
  double fall = 0, strain = 0;
  const std::vector<double> volumes = tet_volumes(model.rest);
  for (const Body& body : model.bodies) {
    const double lowest = body_bounds(body, model.positions).low.y;
    const double drop = settings.ground ? std::max(0.0, lowest - settings.ground_height) : 0;
    fall += body_mass(model, body) * std::abs(settings.gravity) *
            std::max(drop, body_bounds(body, model.rest.positions).size());
    const Material& material = material_of(settings, body.number);
    const double modulus = has_energy(material) ? material.young_modulus : 0;
    for (std::size_t t = body.first_tet; t < body.first_tet + body.tets; ++t) strain += 1e-6 * modulus * volumes[t];
  }
  return settings.gravity != 0 ? fall : strain;
}

}  // namespace

void add_measurement(EnergyLedger& ledger, const Measurement& now, const Model& model, const Settings& settings) {
  if (!now.finite()) return;
  if (now.step < ledger.step) ledger = {};  // somebody went back in time
  ledger.step = now.step;
  const double work_so_far = ledger.work - ledger.by_hand + ledger.work_before;  // of obstacles
  if (now.by_hand && ledger.begun) ledger.by_hand += now.total - ledger.total - (now.work - work_so_far);
  ledger.total = now.total;
  if (!ledger.begun) ledger.work_before = now.work;
  ledger.work = ledger.by_hand + now.work - ledger.work_before;
  ledger.most_work = std::max(ledger.most_work, std::abs(ledger.work));
  const double total = now.total - ledger.work, motion = total - now.stored;
  if (!ledger.begun) {
    ledger.begun = true;
    ledger.not_judged = why_not_judged(model, settings);
    ledger.start = ledger.lowest = now.total, ledger.lowest_motion = motion, ledger.highest = now.potential;
    ledger.reserve = std::max(now.kinetic + now.elastic, reserve(model, settings));
  }
  ledger.rise = std::max(ledger.rise, total - ledger.lowest);
  ledger.rise_of_motion = std::max(ledger.rise_of_motion, motion - ledger.lowest_motion);
  ledger.lowest = std::min(ledger.lowest, total);
  ledger.lowest_motion = std::min(ledger.lowest_motion, motion);
  const SolverMode& mode = solver_mode(settings);
  ledger.created = mode.forces ? ledger.rise : std::min(ledger.rise, ledger.rise_of_motion);
  // A fall that is deeper than to the ground, as into a bowl below it, is part of what the scene has.
  ledger.highest = std::max(ledger.highest, now.potential);
  ledger.reserve = std::max(ledger.reserve, ledger.highest - now.potential);
  ledger.scale = ledger.reserve + ledger.most_work;
}

std::optional<const char*> why_not_judged(const Model& model, const Settings& settings) {
  const SolverMode& mode = solver_mode(settings);
  if (!model.fixtures.empty()) return "fixed vertices move, and their work is not measured";
  if (mode.published) return "mode paper corrects positions as published";
  if (!settings.rigid_contact && any_material(settings, hard)) return "rigid_contact is off";
  const auto deformed = [&](const Body& body) {
    if (has_energy(material_of(settings, body.number))) return false;
    const std::size_t first = body.first_vertex, end = first + body.vertices;
    for (std::size_t v = first + 1; v < end; ++v) {
      const double at_rest = glm::distance(model.rest.positions[v], model.rest.positions[first]);
      if (std::abs(glm::distance(model.positions[v], model.positions[first]) - at_rest) > 1e-6 * model.size)
        return true;
    }
    return false;
  };
  if (std::ranges::any_of(model.bodies, deformed)) return "a body of stiffness starts deformed";
  return std::nullopt;
}

}  // namespace tetpbd
