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

// Of bodies; of leaves as well, with what is counted for candidates at 0.
void find_boxes(Sim& sim, bool leaves) {
  Pairs& p = sim.pairs;
  const std::size_t first = leaves ? p.ranges.counts.at : p.ranges.boxes.at;
  p.empty.copy_to(p.lists, first, first, p.empty.bytes() - first);
  p.boxes.work_groups = p.slices + (leaves ? p.leaves : 0);
  sim.recorder.run(p.boxes);
}

void find_candidates(Sim& sim, double margin) {
  Pairs& p = sim.pairs;
  Recorder& recorder = sim.recorder;
  const float reach = float(margin + p.thickness);
  recorder.use(p.boxes.program).set("margin", reach);
  find_boxes(sim, true);
  recorder.run(p.cull);
  recorder.barrier(GL_COMMAND_BARRIER_BIT);  // which counts the next kernels' work-groups
  for (Pass* query : {&p.query, &p.query_edges}) {
    if (!*query) continue;
    recorder.use(query->program).set("margin", reach);
    recorder.run(*query);
  }
  recorder.barrier(GL_COMMAND_BARRIER_BIT);  // and these those of meet and push
  ++p.detections, p.since = 0;
}

// Of the surface of a body.
struct Extent {
  Bounds places, speeds;  // of speeds, the means of its parts
  double spread = 0;      // m/s, how far from these any is, but a few
};
// m/s, at most.
double speed_of(const Extent& e) {
  return glm::length(glm::max(glm::abs(e.speeds.low), glm::abs(e.speeds.high))) + e.spread;
}
double closing_speed(const Extent& a, const Extent& b) {
  const auto most = glm::max(glm::abs(a.speeds.high - b.speeds.low), glm::abs(b.speeds.high - a.speeds.low));
  return glm::length(most) + a.spread + b.spread;
}

// Whether bodies may touch before the answer after the next comes, and how fast they approach each other.
void decide(Sim& sim, const std::vector<Extent>& bodies) {
  Pairs& p = sim.pairs;
  const Settings& s = sim.settings;
  p.fastest = p.closing = 0;
  for (const Extent& body : bodies) p.fastest = std::max(p.fastest, speed_of(body));
  const double seconds = 2 * double(Pairs::every + 1) * s.dt,
               apart = 2 * (p.fastest + std::abs(s.gravity) * seconds) * seconds + 2 * p.margin + p.thickness;
  p.near = s.contact == "self";
  for (std::size_t a = 0; a < bodies.size(); ++a) {
    if (s.contact == "self") p.closing = std::max(p.closing, closing_speed(bodies[a], bodies[a]));
    for (std::size_t b = a + 1; b < bodies.size(); ++b) {
      if (glm::any(glm::greaterThan(bodies[a].places.low, bodies[b].places.high + apart)) ||
          glm::any(glm::greaterThan(bodies[b].places.low, bodies[a].places.high + apart)))
        continue;
      p.near = true;
      p.closing = std::max(p.closing, closing_speed(bodies[a], bodies[b]));
    }
  }
  if (!p.near) p.since = -1;
}
constexpr double spreads = 2;  // root mean squares that hold all of a body but a few

void take_answer(Sim& sim) {
  Pairs& p = sim.pairs;
  const auto answer = poll_readback<std::byte>(p.requested, p.readback, "contacts", true);
  if (!answer) return;
  const ContactTotals totals = get(*answer, p.ranges.totals)[0];
  p.touches += totals.touching, p.crowded += totals.crowded;
  p.depth = double(std::bit_cast<float>(totals.deepest));
  p.deepest = std::max(p.deepest, p.depth);
  std::vector<Extent> bodies;
  for (const BodyBox& box : get(*answer, p.ranges.boxes)) {
    const auto place = [](const std::uint32_t(&bits)[3]) {
      return glm::dvec3(unsorted(bits[0]), unsorted(bits[1]), unsorted(bits[2]));
    };
    bodies.push_back({{place(box.low), place(box.high)},
                      {place(box.slowest), place(box.fastest)},
                      spreads * double(std::bit_cast<float>(box.spread))});
    // A few vertices may be faster than that, which matters where they cross the margin before the next look.
    const double faster = double(std::bit_cast<float>(box.top)) - speed_of(bodies.back());
    p.outrun += faster * double(Pairs::every) * sim.settings.dt > p.margin;
  }
  decide(sim, bodies);
}

void ask(Pairs& p) {
  p.lists.copy_to(p.readback, 0, 0, p.readback.bytes());
  const auto& totals = p.ranges.totals;
  p.empty.copy_to(p.lists, totals.at, totals.at, totals.bytes());
  p.requested = Fence::here();
}

}  // namespace

Pairs make_pairs(const SolverInput& input) {
  const Model& model = input.model;
  const Settings& settings = input.settings;
  const Tuning& tuning = input.tuning;
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
                        .lanes = tuning.lanes};
  Pairs p;
  p.margin = (settings.contact == "self" ? 1 : 2) * pair_margin(surfaces), p.thickness = surfaces.thickness;
  p.slices = sizes.slices, p.leaves = sizes.leaves, p.items = sizes.items();
  p.ranges = lay_out_pairs(sizes), p.sizes = pair_defines(sizes);
  const auto checked = [&](Buffer buffer) {
    check_storage(tuning, buffer.label(), buffer.bytes());
    return buffer;
  };
  p.mesh = checked(Buffer("surfaces", fill_pair_mesh(surfaces, sizes.all_vertices, p.ranges)));
  if (settings.contact == "self") {
    std::vector<glm::vec4> rest;
    for (const glm::dvec3& x : model.rest.positions) rest.emplace_back(glm::vec3(x), 0);
    p.rest = checked(Buffer("surfaces at rest", rest));
  }
  const std::vector<std::byte> empty = make_empty_lists(p.ranges);
  p.lists = checked(Buffer("contacts", p.ranges.lists.bytes));
  p.lists.write(0, empty.size(), empty.data());
  p.spheres = checked(Buffer("spheres around triangles", sizeof(glm::vec4) * sizes.targets()));
  p.sums = checked(Buffer("corrections by contacts", std::vector<std::byte>(p.ranges.sums.bytes), GL_DYNAMIC_COPY));
  p.empty = Buffer("no contacts", empty);
  p.readback = Buffer("contacts read-back", empty.size(), nullptr, GL_STREAM_READ);

  std::vector<std::string> defines = vertex_defines(input);
  defines.insert(defines.end(), p.sizes.begin(), p.sizes.end());
  defines.push_back(fmt::format("ROW {}u", tuning.row));
  defines.push_back(fmt::format("IMPLICIT {:d}", solver_mode(settings).implicit));
  defines.push_back(fmt::format("SHEETS {:d}", surfaces.thickness > 0));
  defines.push_back(fmt::format("EDGE {:.9g}", surfaces.edge));
  defines.push_back(fmt::format("SELF_MARGIN {:.9g}", pair_margin(surfaces)));
  defines.push_back(fmt::format("CONTACT_SELF {}", settings.contact == "self" ? 1 : 0));
  constexpr std::size_t most_blocks = 10;
  const auto kernel = [&](const char* name, const char* variant) {
    std::vector<std::string> all = defines;
    all.push_back(variant);
    return Program::compute(fmt::format("contact/bodies/{}.comp", name), scheme_words(input), all, most_blocks);
  };
  const auto counted = [&](const char* name, std::size_t number, const char* variant = "ONE_VARIANT",
                           const char* what = "") {
    Pass pass{kernel(name, variant)};
    pass.name = pass.program.label() + what;
    pass.counts_at = p.ranges.counts.at + offsetof(CandidateCounts, groups) + sizeof(WorkGroups) * number;
    return pass;
  };
  p.boxes = {kernel("boxes", "ONE_VARIANT"), sizes.slices + sizes.leaves};
  p.cull = {kernel("cull", "ONE_VARIANT"), sizes.leaves};
  p.query = counted("query", QUERY_GROUPS, "QUERY_EDGES 0");
  if (sizes.edges > 0) p.query_edges = counted("query", EDGE_GROUPS, "QUERY_EDGES 1", " of edges");
  p.meet = counted("meet", LANE_GROUPS, "LAGGED 0"), p.push = counted("push", RECORD_GROUPS);
  p.lag = contacts_lag(model, settings);
  if (p.lag) p.meet_and_push = counted("meet", LANE_GROUPS, "LAGGED 1", ", and push");
  return p;
}

void plan_body_contacts(Sim& sim) {
  Pairs& p = sim.pairs;
  if (!p || sim.steps % Pairs::every != 0) return;
  take_answer(sim);
  give_pairs(sim);
  if (!p.near || p.since < 0) find_boxes(sim, false);
  ask(p);
}

void resolve_body_contacts(Sim& sim, int left) {
  Pairs& p = sim.pairs;
  if (!p || !p.near) return;
  const Settings& s = sim.settings;
  const double h = sim.plan.h, gained = std::abs(s.gravity) * 2 * double(Pairs::every) * s.dt,
               closing = p.closing + gained;
  // Candidates serve while bodies cannot have crossed the margin, or twice it if one of two is stopped by
  // something else; a body that crosses it in a substep gets a wider one, and so do bodies that start deep in
  // each other.
  const double margin =
      std::min(std::max(p.margin, 1.1 * closing * h), sim.model->size) + 2 * std::exchange(p.overlap, 0);
  const double serve = std::max(1.0, std::floor(margin / (h * std::max(closing, 0.5 * (p.fastest + gained)) + 1e-30)));
  // Numbers of contacts that share a vertex, where the next substep wants those that this one sees coming.
  const bool ahead = p.lag && sim.plan.substeps > 1, lagged = ahead && left > 0 && p.counted && p.since >= 0;
  if (p.since < 0 || (!lagged && p.counted && (p.phases & PHASE_SHARED_LAST) == 0)) p.sums.clear();
  give_pairs(sim);
  sim.recorder.give("QuantizedOut", sim.quantized[sim.read_index]);
  // What folds, or is on its way out of another, soon wants other candidates.
  const bool changes = s.contact == "self" || p.depth > 0.1 * p.margin;
  const long steps = changes ? 1 : Pairs::serve_most;
  if (p.since < 0 || double(p.since) >= std::min(serve, double(steps * sim.plan.substeps)))
    find_candidates(sim, margin);
  ++p.since;
  Pass& meet = lagged ? p.meet_and_push : p.meet;
  const bool implicit = solver_mode(s).implicit;
  // Corrections of one pass bring things nearer to those of the next.
  const float closed_most = implicit ? 1e30f : float(std::max({closing, p.fastest + gained, margin / (2 * s.dt)}) * h);
  sim.recorder.use(meet.program).set("closed_most", closed_most);
  // Implicit substeps are long, so what one pass leaves is much: a stack sinks in by 0.7 % after 1, 0.02
  // after 8.
  for (int pass = 0; pass < (implicit ? 8 : 1); ++pass) {
    sim.recorder.run(meet, {{"side", p.side}, {"ahead", unsigned(ahead)}, {"substep", unsigned(p.since)}});
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
  p.requested = {}, p.since = -1;
  std::vector<Extent> bodies;
  for (const Body& body : sim.model->bodies) {
    const auto of_body = [&](const std::vector<glm::dvec3>& all) {
      const auto first = all.begin() + std::ptrdiff_t(body.first_vertex);
      return bounds({first, first + std::ptrdiff_t(body.vertices)});
    };
    bodies.push_back({of_body(state.positions), of_body(state.velocities)});
  }
  decide(sim, bodies);
  p.overlap = p.near ? measure_overlap(*sim.model, state.positions, sim.settings.contact == "self").deepest : 0;
  std::vector<std::uint32_t> words(p.lists.bytes() / 4, ~0u);  // nothing is held
  p.empty.read(0, p.empty.bytes(), words.data());
  p.lists.write(0, p.lists.bytes(), words.data());
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
  if (p)
    for (int turn = 0; turn < 2; ++turn) take_answer(sim), ask(p);
  return p;
}

}  // namespace tetpbd
