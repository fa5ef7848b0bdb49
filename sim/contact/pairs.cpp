#include "sim/contact/pairs.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include "sim/gl/keep_bindings.h"
#include "sim/measure/overlap.h"
#include "sim/sim.h"

namespace tetpbd {

using namespace pair_layout;

bool bodies_touch(const Model& model, const Settings& settings) {
  return settings.contact == "self" || (settings.contact == "bodies" && model.bodies.size() > 1);
}

bool contacts_lag(const Model& model, const Settings& settings) {
  return bodies_touch(model, settings) && !solver_mode(settings).implicit;
}

namespace {

float unsorted(std::uint32_t bits) { return std::bit_cast<float>(bits & 0x80000000u ? bits & 0x7fffffffu : ~bits); }

void give_pairs(Sim& sim) {
  const Pairs& p = sim.pairs;
  Recorder& recorder = sim.recorder;
  recorder.give("PairMesh", p.mesh), recorder.give("PairSpheres", p.spheres);
  recorder.give("PairLists", p.lists), recorder.give("PairRest", p.rest);
  recorder.counts = p.lists.id();
}

// Finds the boxes of bodies; for a broad phase also those of leaves, and resets its counts.
void find_boxes(Sim& sim, bool broad_phase) {
  Pairs& p = sim.pairs;
  const std::size_t first = broad_phase ? p.ranges.counts.at : p.ranges.boxes.at;
  p.empty.copy_to(p.lists, first, first, p.empty.bytes() - first);
  p.boxes.work_groups = p.slices + (broad_phase ? p.leaves : 0);
  sim.recorder.run(p.boxes);
}

void find_candidates(Sim& sim, double margin) {
  Pairs& p = sim.pairs;
  Recorder& recorder = sim.recorder;
  const float reach = float(margin + p.thickness);
  recorder.use(p.boxes.program).set("margin", reach);
  find_boxes(sim, true);
  recorder.run(p.cull);
  recorder.barrier(GL_COMMAND_BARRIER_BIT);  // cull counts the work-groups of the next kernels
  for (Pass* query : {&p.query, &p.query_edges}) {
    if (!*query) continue;
    recorder.use(query->program).set("margin", reach);
    recorder.run(*query);
  }
  recorder.barrier(GL_COMMAND_BARRIER_BIT);  // the queries count the work-groups of meet and push
  ++p.detections, p.age = 0;
}

// Where the surface of a body is and how fast it moves.
struct Extent {
  Bounds positions, velocities;  // of velocities, the means of slices
  double spread = 0;             // m/s, how far all but a few vertices are from these

  double fastest() const { return glm::length(glm::max(glm::abs(velocities.low), glm::abs(velocities.high))) + spread; }
};
double approach_speed(const Extent& a, const Extent& b) {
  const auto most =
      glm::max(glm::abs(a.velocities.high - b.velocities.low), glm::abs(b.velocities.high - a.velocities.low));
  return glm::length(most) + a.spread + b.spread;
}
bool are_apart(const Bounds& a, const Bounds& b, double distance) {
  return glm::any(glm::greaterThan(a.low, b.high + distance)) || glm::any(glm::greaterThan(b.low, a.high + distance));
}

// Decides whether bodies may touch before the readback after the next, and how fast they approach each other.
void plan_detection(Sim& sim, const std::vector<Extent>& bodies) {
  Pairs& p = sim.pairs;
  const Settings& s = sim.settings;
  p.fastest = p.approach_speed = 0;
  for (const Extent& body : bodies) p.fastest = std::max(p.fastest, body.fastest());
  const double seconds = 2 * double(Pairs::readback_interval + 1) * s.dt,
               apart = 2 * (p.fastest + std::abs(s.gravity) * seconds) * seconds + 2 * p.margin + p.thickness;
  const bool self = s.contact == "self";
  p.near = self;
  for (std::size_t a = 0; a < bodies.size(); ++a)
    for (std::size_t b = self ? a : a + 1; b < bodies.size(); ++b) {
      if (a != b && are_apart(bodies[a].positions, bodies[b].positions, apart)) continue;
      p.near = true;
      p.approach_speed = std::max(p.approach_speed, approach_speed(bodies[a], bodies[b]));
    }
  if (!p.near) p.age = -1;
}

void read_contacts(Sim& sim) {
  constexpr double spreads = 2;  // root mean squares from the mean, within which all vertices but a few are
  Pairs& p = sim.pairs;
  const auto contents = poll_readback<std::byte>(p.requested, p.readback, "contacts", true);
  if (!contents) return;
  const ContactTotals totals = get(*contents, p.ranges.totals)[0];
  p.touches += totals.touching, p.crowded += totals.crowded;
  p.depth = double(std::bit_cast<float>(totals.deepest));
  p.deepest = std::max(p.deepest, p.depth);
  std::vector<Extent> bodies;
  for (const BodyBox& box : get(*contents, p.ranges.boxes)) {
    const auto vector = [](const std::uint32_t(&bits)[3]) {
      return glm::dvec3(unsorted(bits[0]), unsorted(bits[1]), unsorted(bits[2]));
    };
    bodies.push_back({{vector(box.low), vector(box.high)},
                      {vector(box.slowest), vector(box.fastest)},
                      spreads * double(std::bit_cast<float>(box.spread))});
    // The few faster vertices matter only if they cross the margin before the next readback.
    const double faster = double(std::bit_cast<float>(box.top_speed)) - bodies.back().fastest();
    p.outrun += faster * double(Pairs::readback_interval) * sim.settings.dt > p.margin;
  }
  plan_detection(sim, bodies);
}

void request_readback(Pairs& p) {
  p.lists.copy_to(p.readback, 0, 0, p.readback.bytes());
  const auto& totals = p.ranges.totals;
  p.empty.copy_to(p.lists, totals.at, totals.at, totals.bytes());
  p.requested = Fence::here();
}

void make_buffers(Pairs& p, const SolverInput& input, const PairMesh& surfaces, const PairSizes& sizes) {
  const auto checked = [&](Buffer buffer) {
    check_storage(input.tuning, buffer.label(), buffer.bytes());
    return buffer;
  };
  p.mesh = checked(Buffer("surfaces", fill_pair_mesh(surfaces, sizes.all_vertices, p.ranges)));
  if (input.settings.contact == "self") {
    std::vector<glm::vec4> rest;
    for (const glm::dvec3& x : input.model.rest.positions) rest.emplace_back(glm::vec3(x), 0);
    p.rest = checked(Buffer("surfaces at rest", rest));
  }
  p.lists = checked(Buffer("contacts", p.ranges.lists.bytes));
  p.spheres = checked(Buffer("spheres around triangles", sizeof(glm::vec4) * sizes.targets()));
  p.sums = checked(Buffer("corrections by contacts", std::vector<std::byte>(p.ranges.sums.bytes), GL_DYNAMIC_COPY));
  p.empty = Buffer("no contacts", make_empty_lists(p.ranges));
  p.readback = Buffer("contacts read-back", p.empty.bytes(), nullptr, GL_STREAM_READ);
}

void make_passes(Pairs& p, const SolverInput& input, const PairMesh& surfaces) {
  const Settings& settings = input.settings;
  std::vector<std::string> defines = vertex_defines(input);
  defines.insert(defines.end(), p.sizes.begin(), p.sizes.end());
  defines.push_back(fmt::format("ROW {}u", input.tuning.row));
  defines.push_back(fmt::format("IMPLICIT {:d}", solver_mode(settings).implicit));
  defines.push_back(fmt::format("SHEETS {:d}", surfaces.thickness > 0));
  defines.push_back(fmt::format("EDGE {:.9g}", surfaces.edge));
  defines.push_back(fmt::format("SELF_MARGIN {:.9g}", pair_margin(surfaces)));
  defines.push_back(fmt::format("CONTACT_SELF {:d}", settings.contact == "self"));
  const auto kernel = [&](const char* name, const char* variant = nullptr) {
    constexpr std::size_t most_blocks = 10;
    std::vector<std::string> all = defines;
    if (variant) all.push_back(variant);
    return Program::compute(fmt::format("contact/bodies/{}.comp", name), scheme_words(input), all, most_blocks);
  };
  const auto counted = [&](Program program, std::size_t number, const char* what = "") {
    Pass pass{std::move(program)};
    pass.name = pass.program.label() + what;
    pass.counts_at = p.ranges.counts.at + offsetof(CandidateCounts, groups) + sizeof(WorkGroups) * number;
    return pass;
  };
  p.boxes = {kernel("boxes"), p.slices + p.leaves};
  p.cull = {kernel("cull"), p.leaves};
  p.query = counted(kernel("query", "QUERY_EDGES 0"), QUERY_GROUPS);
  if (!surfaces.edges.empty()) p.query_edges = counted(kernel("query", "QUERY_EDGES 1"), EDGE_GROUPS, " of edges");
  p.meet = counted(kernel("meet", "LAGGED 0"), LANE_GROUPS);
  p.push = counted(kernel("push"), RECORD_GROUPS);
  if (p.lag) p.meet_and_push = counted(kernel("meet", "LAGGED 1"), LANE_GROUPS, ", and push");
}

}  // namespace

Pairs make_pairs(const SolverInput& input) {
  const Model& model = input.model;
  PairMesh surfaces = pair_mesh(model);
  order_in_leaves(model.rest, surfaces);
  add_tets(model.rest, surfaces);
  const PairSizes sizes{.triangles = surfaces.triangles.size(),
                        .edges = surfaces.edges.size(),
                        .vertices = surfaces.vertices.size(),
                        .leaves = surfaces.leaves.size(),
                        .slices = cut_slices(surfaces).size(),
                        .tets = surfaces.tets.size(),
                        .bodies = model.bodies.size(),
                        .all_vertices = model.positions.size(),
                        .lanes = input.tuning.lanes};
  Pairs p;
  p.lag = contacts_lag(model, input.settings);
  p.margin = (input.settings.contact == "self" ? 1 : 2) * pair_margin(surfaces), p.thickness = surfaces.thickness;
  p.slices = sizes.slices, p.leaves = sizes.leaves, p.items = sizes.items();
  p.ranges = lay_out_pairs(sizes), p.sizes = pair_defines(sizes);
  make_buffers(p, input, surfaces, sizes);
  make_passes(p, input, surfaces);
  return p;
}

void plan_body_contacts(Sim& sim) {
  Pairs& p = sim.pairs;
  if (!p || sim.steps % Pairs::readback_interval != 0) return;
  read_contacts(sim);
  give_pairs(sim);
  if (!p.near || p.age < 0) find_boxes(sim, false);
  request_readback(p);
}

void resolve_body_contacts(Sim& sim, int left) {
  Pairs& p = sim.pairs;
  if (!p || !p.near) return;
  const Settings& s = sim.settings;
  const double h = sim.plan.h, gained = std::abs(s.gravity) * 2 * double(Pairs::readback_interval) * s.dt,
               approach = p.approach_speed + gained;
  // A body that crosses the margin in a substep gets a wider one, and so do bodies that overlap at the start.
  const double margin =
      std::min(std::max(p.margin, 1.1 * approach * h), sim.model->size) + 2 * std::exchange(p.start_depth, 0);
  // Candidates last, in substeps, while bodies cannot cross the margin, or twice the margin if something else stops one
  // of two; only one step where a body folds or leaves another, because other candidates are soon needed there.
  const double lifetime =
      std::max(1.0, std::floor(margin / (h * std::max(approach, 0.5 * (p.fastest + gained)) + 1e-30)));
  const bool changes = s.contact == "self" || p.depth > 0.1 * p.margin;
  const double most_lifetime = double((changes ? 1 : Pairs::most_lifetime) * sim.plan.substeps);
  // Contacts are counted ahead for a next substep that applies corrections itself.
  const bool ahead = p.lag && sim.plan.substeps > 1, lagged = ahead && left > 0 && p.counted && p.age >= 0;
  if (p.age < 0 || (!lagged && p.counted && (p.phases & PHASE_SHARED_LAST) == 0)) p.sums.clear();
  give_pairs(sim);
  sim.recorder.give("QuantizedOut", sim.quantized[sim.read_index]);
  if (p.age < 0 || double(p.age) >= std::min(lifetime, most_lifetime)) find_candidates(sim, margin);
  ++p.age;
  Pass& meet = lagged ? p.meet_and_push : p.meet;
  const bool implicit = solver_mode(s).implicit;
  // Implicit substeps are long: with one pass a stack sinks in by 0.7 %, with eight by 0.02 %. Each pass brings bodies
  // nearer to others, so that what may come near before the next pass has no bound.
  const float closed_most = implicit ? 1e30f : float(std::max({approach, p.fastest + gained, margin / (2 * s.dt)}) * h);
  sim.recorder.use(meet.program).set("closed_most", closed_most);
  for (int pass = 0; pass < (implicit ? 8 : 1); ++pass) {
    sim.recorder.run(meet, {{"side", p.side}, {"ahead", unsigned(ahead)}, {"substep", unsigned(p.age)}});
    if (!lagged) sim.recorder.run(p.push, {{"side", p.side}});
  }
  p.counted = ahead;
  if (ahead) p.side = 1 - p.side;
  p.phases = lagged ? PHASE_TOUCHED | (p.side ? PHASE_SHARED_SIDE : 0u) | (left == 1 ? PHASE_SHARED_LAST : 0u) : 0u;
  give_quantized(sim);
}

void start_pairs(Sim& sim, const State& state) {
  Pairs& p = sim.pairs;
  if (!p) return;
  p.requested = {}, p.age = -1;
  std::vector<Extent> bodies;
  for (const Body& body : sim.model->bodies) {
    const auto body_bounds = [&](const std::vector<glm::dvec3>& all) {
      const auto first = all.begin() + std::ptrdiff_t(body.first_vertex);
      return bounds({first, first + std::ptrdiff_t(body.vertices)});
    };
    bodies.push_back({body_bounds(state.positions), body_bounds(state.velocities)});
  }
  plan_detection(sim, bodies);
  p.start_depth = p.near ? measure_overlap(*sim.model, state.positions, sim.settings.contact == "self").deepest : 0;
  std::vector<std::byte> contents(p.lists.bytes(), std::byte{0xff});  // NONE in all that `empty` does not hold
  std::ranges::copy(make_empty_lists(p.ranges), contents.begin());
  p.lists.write(0, contents.size(), contents.data());
}

void add_carried(Carried& all, Pairs& p) {
  if (!p) return;
  const PairRanges& r = p.ranges;
  all.ranges.push_back({&p.lists, 0, r.depths.at + r.depths.bytes()});  // from totals to depths
  all.ranges.push_back({&p.lists, r.records.at, r.records.bytes()});
  all.add(p.readback);
  if (p.lag) all.ranges.push_back({&p.sums, r.sharing.at, r.sharing.bytes()});
  all.add_values(static_cast<PairNumbers&>(p));
  all.add_readback(p.requested);
}

PairNumbers touched(Sim& sim) {
  const KeepBindings kept;
  Pairs& p = sim.pairs;
  // The first readback may have been requested before the last step.
  if (p)
    for (int turn = 0; turn < 2; ++turn) read_contacts(sim), request_readback(p);
  return p;
}

}  // namespace tetpbd
