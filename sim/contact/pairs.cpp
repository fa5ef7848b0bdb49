#include "sim/contact/pairs.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>
#include <utility>

#include "sim/contact/cell_grid.h"
#include "sim/contact/offset_contact.h"
#include "sim/gl/keep_bindings.h"
#include "sim/sim.h"

namespace tetpbd {

using namespace pair_layout;

bool bodies_touch(const Model& model, const Settings& settings) {
  return settings.contact == "self" || (settings.contact == "bodies" && model.bodies.size() > 1);
}

namespace {

constexpr double least_limit = 0.075, most_limit = 1.5;  // edges, that a vertex may go between detections
constexpr const char *pairs_label = "pairs of surfaces", *candidates_label = "candidates for pairs",
                     *leaf_pairs_label = "pairs of leaves";
constexpr std::size_t group = 64, find_group = 256, pair_group = 32, hard_group = 512;  // invocations

void give_pairs(Sim& sim) {
  const Pairs& p = sim.pairs;
  Recorder& recorder = sim.recorder;
  recorder.give("PairMesh", p.mesh), recorder.give("PairLists", p.lists);
  recorder.give("LeafPairs", p.leaf_pairs), recorder.give("Candidates", p.candidates), recorder.give("Pairs", p.pairs);
  recorder.give("Balls", p.balls);
  if (p.hard) recorder.give("HardPairs", p.hard_pairs);
  if (p.keep) recorder.give("KeptImpulses", p.kept);
  recorder.give("PairSumsByVertex", p.sums), recorder.give("Listed", p.listed);
  recorder.counts = p.lists.id();
}

void find_boxes(Sim& sim, bool detects) {
  Pairs& p = sim.pairs;
  const std::size_t at = p.ranges.counts.at;
  p.empty.copy_to(p.lists, at, at, p.lists.bytes() - at);
  sim.recorder.run(p.boxes, {{"detects", unsigned(detects)}});
  p.boxed = true;
}

// m/s, that no more than a tenth of the leaves exceed.
double high_speed(std::vector<double> speeds) {
  if (speeds.empty()) return 0;
  const auto at = speeds.begin() + std::ptrdiff_t(0.9 * double(speeds.size()));
  std::ranges::nth_element(speeds, at);
  return *at;
}

// Where the surface of a body is and how fast its vertices are.
struct Extent {
  Bounds box;
  double fastest = 0;  // m/s
};

// Decides whether bodies may touch before the readback after the next.
void plan_detection(Sim& sim, const std::vector<Extent>& bodies) {
  Pairs& p = sim.pairs;
  const Settings& s = sim.settings;
  p.fastest = 0;
  for (const Extent& body : bodies) p.fastest = std::max(p.fastest, body.fastest);
  const double seconds = 2 * double(Pairs::readback_interval + 1) * s.dt,
               apart = 2 * (p.fastest + std::abs(s.gravity) * seconds) * seconds + p.edge +
                       std::max(0.0, s.contact_distance);
  p.near = s.contact == "self";
  for (std::size_t a = 0; a < bodies.size() && !p.near; ++a)
    for (std::size_t b = a + 1; b < bodies.size() && !p.near; ++b) {
      const Bounds &one = bodies[a].box, &other = bodies[b].box;
      p.near = !are_apart(grown(one, apart), other);
    }
}

Buffer checked(const Tuning& tuning, Buffer buffer) {
  check_storage(tuning, buffer.label(), buffer.bytes());
  return buffer;
}

template <class T>
void make_room(Buffer& list, const char* label, const Tuning& tuning, std::size_t count) {
  list = checked(tuning, Buffer(label, sizeof(T) * count));
}

// Makes room for four times as many as a detection found, if that was more than a quarter of it.
template <class T>
void follow(Pairs& p, Buffer& list, const char* label, const Tuning& tuning, std::size_t found) {
  const std::size_t room = list.bytes() / sizeof(T), most = tuning.storage / sizeof(T);
  p.left_out += std::max(found, room) - room;
  if (found > room / 4 && room < most) make_room<T>(list, label, tuning, std::min(4 * found, most));
}

// Any pair may be one of hard bodies.
void make_hard_room(Pairs& p, const Tuning& tuning) {
  const std::size_t most = std::min(p.pairs.bytes() / sizeof(SurfacePair), tuning.storage / sizeof(HardPair) - 1);
  p.hard_pairs = checked(tuning, Buffer("pairs of hard bodies", 16 + sizeof(HardPair) * most));
  p.hard_pairs.clear();
}

void read_contacts(Sim& sim) {
  Pairs& p = sim.pairs;
  const auto contents = poll_readback<std::byte>(p.requested, p.readback, "contacts", true);
  if (!contents) return;
  const ContactTotals totals = get(*contents, p.ranges.totals)[0];
  p.touches += totals.touching, p.truncated += totals.truncated;
  p.taken += double(totals.taken) * TAKEN_UNIT;
  p.nearest = std::min(p.nearest, double(std::bit_cast<float>(totals.nearest)));
  p.listed_pairs = std::max<std::uint64_t>(p.listed_pairs, totals.most_pairs);
  const std::size_t room = p.pairs.bytes();
  follow<SurfacePair>(p, p.pairs, pairs_label, sim.tuning, totals.most_pairs);
  if (p.hard && p.pairs.bytes() > room) make_hard_room(p, sim.tuning);
  follow<glm::uvec2>(p, p.candidates, candidates_label, sim.tuning, totals.most_candidates);
  follow<glm::uvec2>(p, p.leaf_pairs, leaf_pairs_label, sim.tuning, totals.most_leaf_pairs);
  std::vector<Extent> bodies(sim.model->bodies.size(), {{glm::dvec3(INFINITY), glm::dvec3(-INFINITY)}, 0});
  const std::vector<glm::vec4> lows = get(*contents, p.ranges.leaf_lows), highs = get(*contents, p.ranges.leaf_highs);
  std::vector<double> speeds;
  for (std::size_t l = 0; l < lows.size(); ++l) {
    Extent& body = bodies[p.leaf_bodies[l]];
    body.box = {glm::min(body.box.low, glm::dvec3(lows[l])), glm::max(body.box.high, glm::dvec3(highs[l]))};
    body.fastest = std::max(body.fastest, double(lows[l].w));
    speeds.push_back(double(lows[l].w));
  }
  plan_detection(sim, bodies);
  p.usual = high_speed(speeds);
}

void request_readback(Pairs& p) {
  p.lists.copy_to(p.readback, 0, 0, p.readback.bytes());
  p.empty.copy_to(p.lists, p.ranges.totals.at, p.ranges.totals.at, p.ranges.totals.bytes());
  p.requested = Fence::here();
}

void make_buffers(Pairs& p, const SolverInput& input, const Surfaces& surfaces, const SurfaceLeaves& leaves) {
  const Model& model = input.model;
  const std::size_t count = model.positions.size(), triangles = model.rest.surface.size();
  p.mesh = checked(input.tuning, Buffer("surfaces", fill_pair_mesh(model, surfaces, leaves, p.ranges)));
  p.empty = Buffer("no pairs", make_empty_lists(p.ranges));
  p.lists = checked(input.tuning, Buffer("leaves of surfaces", make_empty_lists(p.ranges), GL_DYNAMIC_COPY));
  p.sums = checked(input.tuning, Buffer("sums of pairs", std::vector<std::byte>(sizeof(PairSums) * count)));
  p.listed = checked(input.tuning, Buffer("places of listing", std::vector<glm::vec4>(count), GL_DYNAMIC_COPY));
  p.listed_texels = make_texel_view(p.listed);
  p.readback = Buffer("contacts read-back", p.empty.bytes(), nullptr, GL_STREAM_READ);
  p.balls =
      checked(input.tuning, Buffer("balls around parts of surfaces",
                                   sizeof(glm::vec4) * (surfaces.vertices.size() + triangles + surfaces.edges.size())));
  make_room<SurfacePair>(p.pairs, pairs_label, input.tuning, 65536 + 8 * triangles);
  if (input.rigid) make_hard_room(p, input.tuning);
  if (input.rigid || solver_mode(input.settings).implicit) {
    // More that have impulses at once are not taken up by the next list.
    const std::size_t most = 32768 + 4 * triangles;
    p.kept = checked(input.tuning, Buffer("impulses of hard bodies", 16 + sizeof(KeptImpulse) * most));
  }
  make_room<glm::uvec2>(p.candidates, candidates_label, input.tuning, 131072 + 24 * triangles);
  make_room<glm::uvec2>(p.leaf_pairs, leaf_pairs_label, input.tuning, 4096 + 24 * p.leaf_bodies.size());
}

void make_passes(Pairs& p, const SolverInput& input) {
  const Settings& settings = input.settings;
  const bool implicit = solver_mode(settings).implicit;
  std::vector<std::string> defines = vertex_defines(input);
  defines.insert(defines.end(), p.defines.begin(), p.defines.end());
  const double mass = std::accumulate(input.model.masses.begin(), input.model.masses.end(), 0.0);
  defines.insert(defines.end(), {fmt::format("ROW {}u", input.tuning.row), fmt::format("IMPLICIT {:d}", implicit),
                                 fmt::format("GROUP_SIZE {}u", group), fmt::format("HARD_GROUP {}u", hard_group),
                                 fmt::format("MOST_PASSES {}", OffsetContact::most_passes),
                                 fmt::format("SETTLED {}", OffsetContact::settled),
                                 fmt::format("FIND_GROUP {}u", find_group), fmt::format("TOTAL_MASS {:.9g}", mass),
                                 fmt::format("CONTACT_SELF {:d}", settings.contact == "self")});
  const auto kernel = [&](const char* name, bool before_substep = true) {
    std::vector<std::string> all = defines;
    all.push_back(fmt::format("BEFORE_SUBSTEP {:d}", before_substep));
    return Program::compute(fmt::format("contact/bodies/{}.comp", name), {}, all);
  };
  const auto counted = [&](Program program, std::size_t at) {
    Pass pass{std::move(program)};
    pass.counts_at = p.ranges.counts.at + at;
    return pass;
  };
  p.boxes = {kernel("boxes"), p.leaf_bodies.size()};
  p.near_leaves = {kernel("near"), p.leaf_bodies.size()};
  p.cull = {kernel("cull"), p.leaf_bodies.size()};
  p.find = counted(kernel("find"), offsetof(PairCounts, leaf_pair_groups));
  p.list = counted(kernel("list"), offsetof(PairCounts, candidate_groups));
  if (!implicit) p.impulses = counted(kernel("impulses", false), offsetof(PairCounts, pair_groups));
  p.truncate = counted(kernel("truncate", false), offsetof(PairCounts, pair_groups));
  if (input.rigid || implicit) p.keep = counted(kernel("keep"), offsetof(PairCounts, pair_groups));
  if (!input.rigid) return;
  p.hard = {kernel("hard", false), 1};
  p.carry = {kernel("carry", false), work_groups(input.model.positions.size(), group)};
}

// Substeps between detections, so that meanwhile surfaces come nearer by a part of an edge: with much less detections
// take the time, with much more there are many pairs that never touch.
int detection_interval(const Sim& sim) {
  const Pairs& p = sim.pairs;
  const double gained = std::abs(sim.settings.gravity) * double(2 * Pairs::readback_interval) * sim.settings.dt;
  const double usual = 0.2 * p.edge / (p.usual + gained), most = 0.4 * most_limit * p.edge / (p.fastest + gained);
  return int(std::clamp(std::min(usual, most) / sim.plan.h, 1.0, double(sim.plan.substeps)));
}

void keep_impulses(Sim& sim) {
  Pairs& p = sim.pairs;
  if (!p.keep) return;
  p.kept.clear(), p.kept_any = true;
  sim.recorder.run(p.keep, {{"takes_up", 0}});
}

}  // namespace

Pairs make_pairs(const SolverInput& input) {
  const Model& model = input.model;
  const Surfaces surfaces = lay_out_surfaces(model, input.settings.contact_distance);
  const SurfaceLeaves leaves = cut_leaves(model, surfaces);
  const PairSizes sizes{.triangles = model.rest.surface.size(),
                        .edges = surfaces.edges.size(),
                        .surface_vertices = surfaces.vertices.size(),
                        .vertices = model.positions.size(),
                        .places = model.positions.size() * (input.settings.contact == "self" ? 2 : 1),
                        .leaves = leaves.leaves.size()};
  Pairs p;
  for (const SurfaceLeaf& leaf : leaves.leaves) p.leaf_bodies.push_back(leaf.body);
  p.edge = mean_edge(surfaces, model.rest.positions);
  p.ranges = lay_out_pairs(sizes), p.defines = pair_defines(sizes);
  p.defines.push_back(fmt::format("PAIR_GROUP {}u", pair_group));
  make_buffers(p, input, surfaces, leaves);
  make_passes(p, input);
  return p;
}

void plan_body_contacts(Sim& sim) {
  Pairs& p = sim.pairs;
  if (!p) return;
  bind_texels(UNIT_LISTED, p.listed_texels);
  if (sim.steps % Pairs::readback_interval != 0) return;
  read_contacts(sim);
  give_pairs(sim);
  if (!p.near || !p.boxed) find_boxes(sim, false);
  request_readback(p);
}

void forget_impulses(Pairs& p) {
  if (std::exchange(p.kept_any, false)) p.kept.clear();
}

void list_pairs(Sim& sim, int substep) {
  Pairs& p = sim.pairs;
  p.phases = p && (p.near || !sim.led.vertices.empty()) ? PHASE_NEAR : 0u;  // boxes do not know what is led
  if (!p.phases) return forget_impulses(p);
  give_pairs(sim);
  const int interval = detection_interval(sim);
  if (substep % interval != 0) return;
  Recorder& recorder = sim.recorder;
  if (substep > 0) keep_impulses(sim);
  find_boxes(sim, true);
  for (Pass* pass : {&p.near_leaves, &p.cull, &p.find, &p.list}) {
    const Program& program = recorder.use(pass->program);
    program.set("lifetime", float(interval * sim.plan.h));
    program.set("least_limit", float(least_limit * p.edge)), program.set("most_limit", float(most_limit * p.edge));
  }
  recorder.run(p.near_leaves);
  recorder.run(p.cull);
  recorder.barrier(GL_COMMAND_BARRIER_BIT);  // each counts the work-groups of the next
  recorder.run(p.find);
  recorder.barrier(GL_COMMAND_BARRIER_BIT);
  recorder.run(p.list);
  recorder.barrier(GL_COMMAND_BARRIER_BIT | GL_TEXTURE_FETCH_BARRIER_BIT);
  if (p.kept_any) recorder.run(p.keep, {{"takes_up", 1}});
  ++p.detections, p.side = 0;
}

void resolve_body_contacts(Sim& sim, bool last) {
  Pairs& p = sim.pairs;
  if (!p.phases) return;
  Recorder& recorder = sim.recorder;
  recorder.give("QuantizedOut", sim.quantized[sim.read_index]);
  // What has no velocity of its own but that of its motion must not be pushed apart at once.
  const bool by_force = solver_mode(sim.settings).leapfrog;
  const float push_limit = by_force ? 1e30f : float(sim.plan.h / OffsetContact::recovery);
  if (p.impulses) {
    recorder.use(p.impulses.program).set("push_limit", push_limit);
    recorder.run(p.impulses, {{"side", p.side}});
  }
  if (p.hard) recorder.use(p.hard.program).set("push_limit", push_limit), recorder.run(p.hard);
  recorder.run(p.truncate, {{"side", p.side}});
  if (p.carry) run_kernel(sim, p.carry);
  p.side = 1 - p.side;
  if (last) keep_impulses(sim);  // for the next step
  give_quantized(sim);
}

void start_pairs(Sim& sim, const State& state) {
  Pairs& p = sim.pairs;
  if (!p) return;
  p.requested = {}, p.boxed = false;
  std::vector<Extent> bodies;
  for (const Body& body : sim.model->bodies) {
    Extent& extent = bodies.emplace_back(Extent{body_bounds(body, state.positions), 0});
    for (std::size_t i = body.first_vertex; i < body.first_vertex + body.vertices; ++i)
      extent.fastest = std::max(extent.fastest, glm::length(state.velocities[i]));
  }
  plan_detection(sim, bodies);
  p.usual = p.fastest;
  p.lists.write(0, p.empty.bytes(), make_empty_lists(p.ranges).data());
  forget_impulses(p);
}

void add_carried(Carried& all, Pairs& p) {
  if (!p) return;
  all.add(p.lists), all.add(p.readback);
  if (p.keep) all.add(p.kept);
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
