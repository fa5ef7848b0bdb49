// Implicit steps: BDF2, a Newton step for each, by conjugate gradients with a preconditioner of two levels
// (method.md, "Implicit steps").
#include <fmt/format.h>

#include <future>
#include <map>
#include <memory>
#include <tuple>

#include "sim/contact/offset_contact.h"
#include "sim/sim.h"
#include "sim/solvers/newton_buffers.h"
#include "sim/solvers/rings.h"

namespace tetpbd {

namespace {

// A refresh of the coarse level, which a thread makes while the present one is in use. It is taken over a fixed number
// of steps later, waiting if need be, so that runs are the same whatever the machine does.
struct Refresh {
  std::future<std::vector<glm::vec4>> inverse;
  long steps = 0;      ///< until it is taken over
  bool again = false;  ///< settings have changed since it began
};

struct Newton {
  Pass begin, predict, start, linearise, residual, update, coarse, prolong, product, finish;
  Pass averages, stresses;   ///< only where tets are smoothed
  Pass again;                ///< before a second round
  Pass momentum;             ///< only where a body is free
  Pass start_motion, place;  ///< only where obstacles can stop one
  Pass meet, islands, start_moves, press_at_start, press_product, end_moves,
      press_at_end;         ///< only where bodies may touch
  Buffer presses, touches;  ///< by pair of surfaces, and by body
  std::vector<std::string> defines, vertex_defines;
  std::shared_ptr<const NewtonLevels> levels;
  std::shared_ptr<const Model> joined;  ///< of which attached bodies are one; null: the Sim's own
  NewtonBuffers layout;
  std::size_t vectors = 0, mesh = 0, coarse_matrix = 0, sums = 0, rings = 0;  ///< indices of Solver::buffers
  Refresh refresh;
  double refreshed_for = 0;  ///< s, the substep of the last refresh
  /// The coarse level by the substep it is for, with the present forces: substeps change back and forth.
  std::map<double, std::vector<glm::vec4>> coarse_levels;
};

Newton make_passes(const SolverInput& input, const NewtonSizes& sizes) {
  const std::vector<std::string> defines = newton_defines(sizes, input);
  const ShaderWords words{{}, kind_words(input.system)};
  std::vector<std::string> defines_at_start = defines;
  defines_at_start.push_back("AT_START 1");
  const auto pass = [&](const char* name, std::size_t work_groups, std::size_t bytes, bool at_start = false) {
    return Pass{
        Program::compute(fmt::format("solvers/newton/{}.comp", name), words, at_start ? defines_at_start : defines),
        std::max<std::size_t>(work_groups, 1), bytes};
  };
  const auto groups = [&](std::size_t items) { return (items + sizes.group - 1) / sizes.group; };
  const std::size_t count = sizes.aggregates, turns = sizes.product_groups, vector = 16 * sizes.vertices,
                    of_matrix = 2 * 56 * sizes.edges;
  Newton n;
  n.begin = pass("begin", groups(std::max(sizes.vertices, count)), 2 * vector);
  n.predict = pass("predict", groups(sizes.vertices), 12 * vector);
  n.start = pass("start", count + groups(sizes.tets), 4 * 80 * sizes.tets);
  n.linearise = pass("linearise", groups(sizes.edges), sizeof(newton::EdgeBlock) * sizes.edges + 4 * sizes.uses * 30);
  n.residual = pass("residual", turns, of_matrix + 9 * vector);
  n.update = pass("update", count + groups(sizes.vertices), 15 * vector);
  n.coarse = pass("coarse", groups(sizes.row_lanes * sizes.unknowns()), 16 * sizes.coarse);
  n.prolong = pass("prolong", groups(sizes.vertices), 7 * vector);
  n.product = pass("product", turns, of_matrix + 4 * vector);
  if (has_averages(input.system)) {
    const std::size_t rings = 32 * sizes.edges * 2;
    n.averages = pass("averages", turns, rings + 24 * 16 * sizes.vertices);
    n.stresses = pass("stresses", turns, rings + 32 * sizes.edges + 7 * vector);
  }
  n.finish = pass("finish", groups(sizes.vertices), 14 * vector);
  n.again = pass("again", groups(sizes.vertices), 14 * vector);
  if (sizes.free_bodies > 0) n.momentum = pass("momentum", sizes.parts * sizes.free_bodies, 7 * vector);
  if (sizes.rigid_start) {
    n.start_motion = pass("momentum", sizes.parts * sizes.free_bodies, 5 * vector, true);
    n.place = pass("place", groups(sizes.vertices), 8 * vector);
  }
  return n;
}

// Attached bodies have one matrix, and are solved as one body, with those that stand between them in the list.
std::shared_ptr<const Model> join_attached(const Model& model) {
  if (model.attachments.empty()) return nullptr;
  auto joined = std::make_shared<Model>(model);
  std::vector<char> goes_on(model.bodies.size(), 0);  // into the next body
  for (const Attachment& a : model.attachments)
    for (std::size_t b = std::min(a.body, a.to); b < std::max(a.body, a.to); ++b) goes_on[b] = 1;
  joined->bodies.clear();
  for (std::size_t b = 0; b < model.bodies.size(); ++b) {
    const Body& body = model.bodies[b];
    if (b == 0 || !goes_on[b - 1]) {
      joined->bodies.push_back(body);
      continue;
    }
    Body& whole = joined->bodies.back();
    whole.vertices += body.vertices, whole.tets += body.tets, whole.triangles += body.triangles;
  }
  return joined;
}

constexpr std::size_t press_bytes = 32;  // of a Press in newton/press.glsl

// The passes that need a Sim's pairs of surfaces, which are made after its solver.
void make_presses(Sim& sim, Newton& n) {
  const Pairs& p = sim.pairs;
  const auto pass = [&](const char* name, std::vector<std::string> defines, const char* more = nullptr) {
    if (more) defines.push_back(more);
    Pass made{Program::compute(fmt::format("solvers/newton/{}.comp", name), {}, defines)};
    made.counts_at = p.ranges.counts.at + offsetof(pair_layout::PairCounts, pair_groups);
    return made;
  };
  std::vector<std::string> of_pairs = n.vertex_defines;
  of_pairs.insert(of_pairs.end(), p.defines.begin(), p.defines.end());
  n.meet = pass("meet", of_pairs, "MEETS 1");
  n.islands = pass("islands", n.defines);
  n.islands.work_groups = 1;
  const std::size_t bodies = (n.joined ? n.joined : sim.model)->bodies.size();
  n.touches = Buffer("bodies that press each other", std::vector<GLuint>(bodies * ((bodies + 31) / 32)));
  n.start_moves = pass("displace", n.defines, "AT_END 0"), n.end_moves = pass("displace", n.defines, "AT_END 1");
  n.start_moves.work_groups = n.end_moves.work_groups = n.predict.work_groups;
  n.press_at_start = pass("press", of_pairs, "PRESS_AT 0");
  n.press_product = pass("press", of_pairs, "PRESS_AT 1");
  n.press_at_end = pass("press", of_pairs, "PRESS_AT 2");
}

// Whether pairs of surfaces are part of this substep's matrix; then gives kernels what they need.
bool presses(Sim& sim, Newton& n) {
  const Pairs& p = sim.pairs;
  if (!p || !p.phases) return false;
  const std::size_t room = p.pairs.bytes() / sizeof(pair_layout::SurfacePair);
  if (!n.presses || n.presses.bytes() < press_bytes * room) n.presses = Buffer("presses", press_bytes * room);
  sim.recorder.give("Presses", n.presses), sim.recorder.give("Touches", n.touches);
  return true;
}

void run_round(Sim& sim, Newton& n, unsigned iterations, unsigned again) {
  const bool together = (again & TOGETHER) != 0;
  run_kernel(sim, n.start, again);
  if (n.averages) run_kernel(sim, n.averages, again);
  if (together) run_kernel(sim, n.start_moves, again), run_kernel(sim, n.press_at_start, again);
  run_kernel(sim, n.linearise, again), run_kernel(sim, n.residual, again);
  for (unsigned k = 0; k < iterations; ++k) {
    run_kernel(sim, n.update, k | again), run_kernel(sim, n.coarse, k | again), run_kernel(sim, n.prolong, k | again);
    if (n.stresses) run_kernel(sim, n.stresses, k | again);
    if (together) run_kernel(sim, n.press_product, (k + 1) | again);
    run_kernel(sim, n.product, (k + 1) | again);
  }
}

void run_substep(Sim& sim, Newton& n) {
  const unsigned changed = std::exchange(sim.adaptive.changed, false) ? PHASE_CHANGED : 0u;
  run_kernel(sim, n.predict, changed);
  const unsigned together = presses(sim, n) ? TOGETHER : 0u;
  // The coarse level does not know how bodies move each other, which takes more iterations: half as many again.
  const unsigned iterations = unsigned(together ? (3 * sim.plan.iterations + 1) / 2 : sim.plan.iterations);
  if (together) {
    sim.recorder.use(n.meet.program).set("push_limit", float(sim.plan.h / OffsetContact::recovery));
    run_kernel(sim, n.meet), run_kernel(sim, n.islands);
  }
  if (n.place) {
    run_kernel(sim, n.start_motion), run_kernel(sim, n.place, changed | together);
    if (together) run_kernel(sim, n.start_motion, together);  // how bodies answer a force now
  }
  run_round(sim, n, iterations, together);
  const unsigned again =
      iterations > 0 && sim.adaptive.substep_factor > 1 && sim.adaptive.hard_readbacks > 0 ? AGAIN : 0;
  if (again) run_kernel(sim, n.again, iterations | together), run_round(sim, n, iterations, again | together);
  const unsigned end = iterations | again | together;
  if (together) run_kernel(sim, n.end_moves, end), run_kernel(sim, n.press_at_end, end);
  if (n.momentum && iterations > 0) run_kernel(sim, n.momentum, end);
  run_kernel(sim, n.finish, end);
}

void begin_refresh(Sim& sim, Newton& n) {
  Refresh& r = n.refresh;
  r.again = r.inverse.valid();
  if (r.again) return;
  n.refreshed_for = sim.plan.h;
  r.inverse =
      std::async(std::launch::async, [model = n.joined ? n.joined : sim.model,
                                      system = soften(sim.system, *sim.model, sim.solver.stiffness_shares),
                                      settings = sim.settings, plan = sim.plan, levels = n.levels, layout = n.layout] {
        return fill_newton_coarse({*model, system, settings, plan, {}}, *levels, layout);
      });
  r.steps = 8 + long(sim.model->rest.tets.size() / 1000);  // about as long as the thread takes, at real time
}

void write_coarse_level(Sim& sim, const Newton& n, const std::vector<glm::vec4>& level) {
  const Buffer& to = sim.solver.buffers[n.coarse_matrix];
  to.write(0, to.bytes(), level.data());
}

void end_refresh(Sim& sim, Newton& n) {
  write_coarse_level(sim, n, n.coarse_levels[n.refreshed_for] = n.refresh.inverse.get());
  if (!n.refresh.again) return;
  n.coarse_levels.clear();  // of forces that have changed since
  begin_refresh(sim, n);
}

// Refreshes at once, for the present plan.
void refresh(Sim& sim, Newton& n) {
  while (n.refresh.inverse.valid()) end_refresh(sim, n);
  if (n.refreshed_for == sim.plan.h) return;
  if (const auto kept = n.coarse_levels.find(sim.plan.h); kept != n.coarse_levels.end()) {
    n.refreshed_for = sim.plan.h;
    return write_coarse_level(sim, n, kept->second);
  }
  begin_refresh(sim, n), end_refresh(sim, n);
}

void make_plan(Sim& sim) {
  sim.plan = plan_for(sim.settings);
  sim.plan.substeps *= sim.adaptive.substep_factor;
  sim.plan.h = sim.settings.dt / sim.plan.substeps;
}

void set_substep_factor(Sim& sim, Newton& n, int times) {
  if (std::exchange(sim.adaptive.substep_factor, times) == times) return;
  const int before = sim.plan.substeps;
  make_plan(sim);
  refresh(sim, n);
  write_step_block(sim, before);
  sim.adaptive.changed = true;
}

// Takes more substeps while a body is unhealthy or near another, and some readbacks longer; and Newton twice in each
// while it is unhealthy, because it may have ended far from where it linearised. With more substeps 28 of 37 hard
// cases of a block of 100 MPa and Poisson's ratio 0.495 end well by 8 iterations, without 7. A block that spins at 100
// rad/s loses 20 % of its spin in half a second in two substeps of 5 ms, with them 1 %.
void adapt_substeps(Sim& sim, Newton& n) {
  constexpr int enough = 8, most = 100;  // readbacks
  AdaptiveSubsteps& w = sim.adaptive;
  const bool near = sim.pairs && sim.pairs.near, hard = w.health == float(HEALTH_FAST);
  w.hard_readbacks = hard ? enough : std::max(0, w.hard_readbacks - 1);
  w.calm_readbacks = w.health < LEAST_HEALTH || near ? 0 : w.calm_readbacks + 1;
  if (near)
    w.refined_readbacks = 0;
  else if (w.substep_factor > 1 && w.health != float(HEALTH_TURNING) && w.health != float(HEALTH_FAST))
    ++w.refined_readbacks;
  if (w.substep_factor == 1 && w.calm_readbacks == 0 && w.refined_readbacks < most)
    set_substep_factor(sim, n, refined_substeps);
  if (w.substep_factor > 1 && w.calm_readbacks == enough) w.refined_readbacks = 0, set_substep_factor(sim, n, 1);
  if (w.substep_factor > 1 && w.refined_readbacks == most) set_substep_factor(sim, n, 1);
}

// rad/s of the body that spins fastest.
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

void start(Sim& sim, Newton& n, const State& state) {
  while (n.refresh.inverse.valid()) end_refresh(sim, n);
  AdaptiveSubsteps& w = sim.adaptive;
  w = AdaptiveValues{.substep_factor = w.substep_factor};
  if (sim.pairs && !n.meet) make_presses(sim, n);
  const double turn = fastest_spin(*sim.model, state) * plan_for(sim.settings).h;
  const bool near = sim.pairs && sim.pairs.near;
  set_substep_factor(sim, n, turn > TURN_LIMIT || near ? refined_substeps : 1);
}

void prepare(Sim& sim, Newton& n) {
  if (n.refresh.inverse.valid() && --n.refresh.steps == 0) end_refresh(sim, n);
  AdaptiveSubsteps& w = sim.adaptive;
  if (!w.readback) return;
  if (sim.steps % AdaptiveSubsteps::every == 0 && poll_convergence(sim) && !n.refresh.inverse.valid())
    adapt_substeps(sim, n);
  w.most_substeps = std::max(w.most_substeps, sim.plan.substeps);
}

void retune(Sim& sim, Newton& n, const Settings* before) {
  make_plan(sim);
  if (!before) return;
  const std::vector<float> shares = stiffness_shares(*sim.model, sim.settings);
  const bool other_shares = std::exchange(sim.solver.stiffness_shares, shares) != shares;
  const Buffer& mesh = sim.solver.buffers[n.mesh];
  const auto forces = [](const Settings& s) { return std::tuple(s.compliance, s.constraint_damping, plan_for(s).h); };
  const bool others = other_shares || !same_constraints(*before, sim.settings);
  const ConstraintSystem system = others ? soften(sim.system, *sim.model, shares) : ConstraintSystem{};
  for (std::size_t k = 0; others && k < kind_count; ++k)
    for (const auto& [name, array, range] : constraint_arrays)
      write(mesh, n.layout.constraints[k].*range, to_floats(system.lists[k].*array));
  if (others && has_averages(system)) {
    const std::vector<glm::uvec4> words = ring_words(system.averages);
    sim.solver.buffers[n.rings].write(0, words.size() * sizeof words[0], words.data());
  }
  if (!others && forces(*before) == forces(sim.settings)) return;
  n.coarse_levels.clear();
  begin_refresh(sim, n);
}

}  // namespace

Solver create_newton_solver(const SolverInput& whole) {
  Solver solver;
  solver.stiffness_shares = stiffness_shares(whole.model, whole.settings);
  const ConstraintSystem softened =
      solver.stiffness_shares.empty() ? ConstraintSystem{} : soften(whole.system, whole.model, solver.stiffness_shares);
  const std::shared_ptr<const Model> joined = join_attached(whole.model);
  const SolverInput input{joined ? *joined : whole.model,
                          solver.stiffness_shares.empty() ? whole.system : softened,
                          whole.settings,
                          whole.plan,
                          whole.tuning,
                          whole.software,
                          whole.compliant,
                          whole.fine_quanta,
                          whole.rigid};
  const auto levels = std::make_shared<const NewtonLevels>(build_newton_levels(input.model, input.system));
  const NewtonSizes sizes = measure_newton(input, *levels);
  const auto made = std::make_shared<Newton>(make_passes(input, sizes));
  Newton& n = *made;
  n.defines = newton_defines(sizes, input), n.vertex_defines = vertex_defines(input);
  n.vertex_defines.insert(n.vertex_defines.end(), {define("BEFORE_SUBSTEP", 0), define("IMPLICIT", 1),
                                                   define("CONTACT_SELF", input.settings.contact == "self")});
  for (const std::string& define : n.defines)
    if (define.starts_with("TOTAL_MASS") || define.starts_with("BODIES")) n.vertex_defines.push_back(define);
  n.joined = joined;
  n.levels = levels, n.layout = lay_out_newton_buffers(sizes, input.system);
  n.refreshed_for = input.plan.h;
  const auto add = [&](const char* block, Buffer buffer) {
    add_buffer(solver, input.tuning, block, std::move(buffer));
    return solver.buffers.size() - 1;
  };
  n.vectors = add("Vectors", Buffer("vectors", fill_newton_vectors(input.model, n.layout), GL_DYNAMIC_COPY));
  const std::size_t of_averages = has_averages(input.system) ? 6 * sizes.vertices + 2 * sizes.edges : 0;
  add("Blocks", Buffer("matrix", std::max<std::size_t>(sizes.edges, 1) * sizeof(newton::EdgeBlock) + 16 * of_averages));
  if (has_averages(input.system)) n.rings = add("Rings", Buffer("rings", ring_words(input.system.averages)));
  n.mesh = add("Mesh", Buffer("constraints and edges", fill_newton_mesh(input, *levels, sizes, n.layout)));
  n.coarse_matrix = add("Coarse", Buffer("coarse matrix", fill_newton_coarse(input, *levels, n.layout)));
  n.sums = add("Sums", Buffer("sums", std::vector<std::byte>(n.layout.sums.bytes), GL_DYNAMIC_COPY));
  if (any_material(input.settings, yields)) {
    solver.rest_block = "Mesh";
    const std::size_t first = n.layout.constraints[index_of<NeoHookean>].values.at / sizeof(float);
    for (std::uint32_t c = 0; c < input.system.lists[index_of<NeoHookean>].count(); ++c)
      solver.rest_copies.push_back({c, std::uint32_t(first + NeoHookean::row.values * c)});
  }
  solver.watches = solver.takes_constraints = true;
  solver.start = [made](Sim& sim, const State& state) { start(sim, *made, state); };
  solver.predict = [made](Sim& sim) { run_kernel(sim, made->begin); };
  solver.prepare = [made](Sim& sim) { prepare(sim, *made); };
  solver.substep = [made](Sim& sim, int) { run_substep(sim, *made); };
  solver.retune = [made](Sim& sim, const Settings* before) { retune(sim, *made, before); };
  solver.refresh = [made](Sim& sim) { refresh(sim, *made); };
  solver.carried = [made](Sim& sim, Carried& all) {
    const std::vector<Buffer>& buffers = sim.solver.buffers;
    for (const std::size_t slot : {newton::DISPLACEMENT, newton::GAIN, newton::LEFT, newton::OWN, newton::OWN2})
      all.ranges.push_back({&buffers[made->vectors], made->layout.slots[slot].at, made->layout.slots[slot].bytes()});
    all.ranges.push_back({&buffers[made->sums], made->layout.rotations.at, made->layout.rotations.bytes()});
    if (made->momentum)
      all.ranges.push_back({&buffers[made->sums], made->layout.motions.at, made->layout.motions.bytes()});
  };
  return solver;
}

}  // namespace tetpbd
