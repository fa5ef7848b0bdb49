#include "app/lab/verdict.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <nlohmann/json.hpp>

#include "sim/model/material.h"
#include "sim/solvers/solver.h"

namespace tetpbd {

namespace {

constexpr std::array<const char*, 3> names = {"right", "doubtful", "wrong"};

// The tet that is flattest, where it is so flat that it decides what a solver can do: its volume is below a hundredth
// of that of a regular one with its longest edge.
std::optional<std::size_t> find_sliver(const TetMesh& mesh) {
  constexpr double flat = 0.01;
  const std::vector<double> volumes = tet_volumes(mesh);
  std::optional<std::size_t> worst;
  double least = flat;
  for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
    double longest = 0;
    for (const std::uint32_t a : mesh.tets[t])
      for (const std::uint32_t b : mesh.tets[t])
        longest = std::max(longest, glm::distance(mesh.positions[a], mesh.positions[b]));
    const double shape = 6 * std::sqrt(2.0) * volumes[t] / std::pow(longest, 3);
    if (shape < least) least = shape, worst = t;
  }
  return worst;
}

// The remedy for a solver that does not hold, by the likeliest cause: the mesh, the mode, the settings.
std::string solver_remedy(const Sim& sim) {
  const SolverMode& mode = solver_mode(sim.settings);
  if (const auto tet = find_sliver(sim.model->rest))
    return fmt::format("the mesh has slivers, the flattest is tet {}: give a cleaner one", *tet);
  if (!mode.forces && any_material(sim.settings, has_energy))
    return "corrections do not hold such a material: take mode newton or explicit";
  if (mode.leapfrog) return "take a smaller --stability";
  if (mode.implicit) return "take more --substeps, or mode explicit";
  return mode.forces ? "take more --iterations or --substeps" : "take more --substeps";
}

// m, between where the bodies' centre of mass is and where gravity alone would have taken it.
double distance_from_fall(const Measurement& first, const Measurement& last, const Sim& sim, double mass) {
  const double t = last.time - first.time;
  const glm::dvec3 gravity(0, -sim.settings.gravity, 0);
  return glm::distance(last.centre, first.centre + t * first.momentum / mass + 0.5 * t * t * gravity);
}

}  // namespace

std::optional<Verdict::Finding> judge_energy(const EnergyLedger& ledger, const Sim& sim) {
  if (ledger.not_judged || !(ledger.relative() > 0.01)) return std::nullopt;
  return Verdict::Finding{ledger.relative() > 100 ? Verdict::wrong : Verdict::doubtful,
                          fmt::format("{:.3g} J came from nothing, {:.3g} % of what the scene has", ledger.created,
                                      100 * ledger.relative()),
                          solver_remedy(sim)};
}

Verdict judge(const RunErrors& errors, Sim& sim) {
  Verdict verdict;
  const auto find = [&](Verdict::Level level, const std::string& what, const std::string& remedy) {
    verdict.findings.push_back({level, what, remedy});
  };
  if (!errors.first || !errors.last) return verdict;
  const Measurement &first = *errors.first, &last = *errors.last;
  if (const auto gain = judge_energy(errors.ledger, sim)) verdict.findings.push_back(*gain);
  double mass = 0;
  for (const double m : sim.model->masses) mass += m;
  const double held = sim.settings.ground ? glm::distance(last.centre, first.centre) : INFINITY;
  const double away = std::min(held, distance_from_fall(first, last, sim, mass));
  if (away > 1000 * sim.model->size)
    find(Verdict::wrong, fmt::format("bodies are {:.3g} m from where they could be", away), solver_remedy(sim));
  if (last.inverted_tets > first.inverted_tets)
    find(Verdict::doubtful, fmt::format("{} tets are inverted at the end", long(last.inverted_tets)),
         first.inverted_tets > 0 ? "the mesh has some at the start: repair it" : solver_remedy(sim));
  if (errors.max_volume_loss_percent > 50)
    find(Verdict::doubtful, fmt::format("{:.3g} % of the volume was lost", errors.max_volume_loss_percent),
         "take a stiffer material, or: " + solver_remedy(sim));
  if (errors.overlap && errors.overlap->largest > 0.05)
    find(Verdict::doubtful, fmt::format("bodies were {:.3g} % of a size in each other", 100 * errors.overlap->largest),
         "take more --substeps");
  if (errors.crossed) {
    const Crossings& crossings = errors.overlap->crossings;
    const auto body = [&](std::uint32_t t) { return body_at(*sim.model, sim.model->rest.surface[t][0]).name; };
    find(Verdict::wrong,
         fmt::format("after step {} surfaces cut each other, {} pairs of triangles, {} of body '{}' and {} of '{}' "
                     "first",
                     *errors.crossed, crossings.pairs, crossings.first[0], body(crossings.first[0]), crossings.first[1],
                     body(crossings.first[1])),
         sim.settings.contact == "none" ? "let them touch: --contact bodies" : "take more --substeps");
  }
  if (solver_mode(sim.settings).implicit && adaptive_values(sim).largest_residual > 1)
    find(Verdict::doubtful, "a residual did not fall", "take more --iterations");
  const GuardCounts guards = guard_counts(sim);
  const auto told = [&](unsigned guard, const char* what) {
    const std::uint64_t count = guards[std::size_t(std::countr_zero(guard))];
    if (count > 0) find(Verdict::doubtful, fmt::format("{} corrections were {}", count, what), solver_remedy(sim));
  };
  told(GUARD_LIMIT, "longer than a body and cut short"), told(GUARD_NOT_FINITE, "no numbers and dropped");
  if (const std::uint64_t count = touched(sim).left_out; count > 0)
    find(Verdict::doubtful, fmt::format("{} pairs of surfaces had no room, so their vertices were held", count),
         "take a shorter --dt");
  for (const StartMotion& motion : sim.model->start_motions)
    if (!motion.from.empty())
      find(Verdict::doubtful, fmt::format("body '{}' started inside {} and was moved", motion.body, motion.from),
           "place it outside");
  std::ranges::stable_sort(verdict.findings, std::greater(), &Verdict::Finding::level);
  return verdict;
}

std::string verdict_line(const Verdict& verdict) {
  std::string line = fmt::format("verdict: {}", names[verdict.level()]);
  for (std::size_t f = 0; f < verdict.findings.size(); ++f)
    line += fmt::format("{} {} ({})", f ? ";" : ":", verdict.findings[f].what, verdict.findings[f].remedy);
  return line;
}

nlohmann::ordered_json verdict_json(const Verdict& verdict) {
  nlohmann::ordered_json findings = nlohmann::ordered_json::array();
  for (const Verdict::Finding& f : verdict.findings)
    findings.push_back({{"level", names[f.level]}, {"what", f.what}, {"remedy", f.remedy}});
  return {{"level", names[verdict.level()]}, {"findings", findings}};
}

}  // namespace tetpbd
