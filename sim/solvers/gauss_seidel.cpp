// Gauss-Seidel by colours on the GPU (method.md, mode gauss-seidel): a dispatch for each colour of clusters, whose
// constraints move vertices in place, then one for contacts.
#include <fmt/format.h>

#include <memory>
#include <string>

#include "sim/sim.h"
#include "sim/solvers/clusters.h"
#include "sim/solvers/jacobi.h"

namespace tetpbd {

namespace {

// A small one, because a colour has few clusters.
constexpr unsigned cluster_group = 32;
constexpr unsigned vertex_group = 256;

struct Colour {
  std::string name;
  std::size_t first, end;  // clusters
};
struct GaussSeidel {
  Pass solve, settle;
  std::vector<Colour> colours;
  std::size_t bytes_of_cluster = 0;
};

void solve_colours(Sim& sim, GaussSeidel& gs, unsigned phases) {
  for (const Colour& colour : gs.colours) {
    const std::size_t clusters = colour.end - colour.first;
    gs.solve.work_groups = work_groups(clusters, cluster_group);
    sim.recorder.run(
        gs.solve,
        {{"phases", phases}, {"first_cluster", unsigned(colour.first)}, {"end_cluster", unsigned(colour.end)}},
        colour.name.c_str(), gs.bytes_of_cluster * clusters);
  }
}

void settle(Sim& sim, GaussSeidel& gs, unsigned phases) {
  const bool finishes = phases & PHASE_FINISH;
  const char* name = finishes ? ", finish" : phases & PHASE_PREDICT ? ", predict" : "";
  run_kernel(sim, gs.settle, phases | (finishes ? sim.pairs.phases : 0), name);
}

void run_substep(Sim& sim, GaussSeidel& gs) {
  settle(sim, gs, PHASE_PREDICT);
  const int iterations = sim.plan.iterations;
  for (int iteration = 0; iteration < iterations; ++iteration) {
    const unsigned finish = iteration + 1 == iterations ? PHASE_FINISH : 0;
    solve_colours(sim, gs, PHASE_SOLVE | (iteration == 0 ? PHASE_PREDICT : 0) | finish);
    settle(sim, gs, PHASE_SOLVE | finish);
  }
  if (iterations == 0) settle(sim, gs, PHASE_FINISH);
}

Pass make_settle_pass(const SolverInput& input) {
  const std::size_t vertices = input.model.positions.size();
  std::vector<std::string> defines = vertex_defines(input);
  defines.push_back(define("GROUP_SIZE", vertex_group));
  return {Program::compute("solvers/settle.comp", {}, defines), work_groups(vertices, vertex_group),
          vertices * 2 * (sizeof(Position) + sizeof(Velocity))};
}

}  // namespace

Solver create_gauss_seidel_solver(const SolverInput& input) {
  Solver solver;
  solver.keeps_prediction = true;
  if (input.rigid) add_prediction(solver, input);  // what neighbours see is the state itself
  const auto gs = std::make_shared<GaussSeidel>();
  const Clusters clusters =
      cluster_constraints(input.system, input.tuning.patch ? input.tuning.patch : Clusters::usual);
  if (!clusters.members.empty()) {
    const Patches patches = pack_patches(input.system, clusters.members, any_material(input.settings, yields));
    gs->solve = make_patch_pass(solver, input, patches, "solvers/gauss_seidel.comp", cluster_group);
    const std::size_t positions = 2 * sizeof(Position) * patches.vertices.size();  // at least, as caches serve the rest
    gs->bytes_of_cluster = (gs->solve.bytes + positions) / patches.count;
    gs->solve.bytes = 0;
  }
  for (std::size_t c = 0; c + 1 < clusters.first.size(); ++c)
    gs->colours.push_back({fmt::format(", colour {}", c + 1), clusters.first[c], clusters.first[c + 1]});
  gs->settle = make_settle_pass(input);
  solver.substep = [gs](Sim& sim, int) { run_substep(sim, *gs); };
  return solver;
}

}  // namespace tetpbd
