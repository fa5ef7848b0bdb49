#include "sim/pairs.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include "sim/overlap.h"
#include "sim/sim.h"

namespace tetpbd {

bool bodies_touch(const Model& model, const Settings& settings) {
  return settings.contact == "self" || (settings.contact == "bodies" && model.bodies.size() > 1);
}

bool contacts_lag(const Model& model, const Settings& settings) {
  return bodies_touch(model, settings) && !is_implicit(settings);
}

namespace {

// pairs.glsl
constexpr std::uint32_t counters = 18, box = 13, candidates = 8, record = 3 + candidates, group = 64,
                        near_leaves = 63;
enum Counter { touching, deepest, found, groups = 4, lane_groups = 7, query_groups = 10, edge_groups = 13 };

float unsorted(std::uint32_t bits) {
  return std::bit_cast<float>(bits & 0x80000000u ? bits & 0x7fffffffu : ~bits);
}

void run(Pairs::Kernel& kernel, const Sim& sim) {
  kernel.program.use();
  if (sim.kernels_timed) kernel.timer.begin();
  if (kernel.work_groups)
    dispatch(kernel.work_groups, sim.tuning.row);
  else
    glDispatchComputeIndirect(GLintptr(4 * kernel.counted_by));
  if (sim.kernels_timed) kernel.timer.end();
  glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT);
}

void bind_pairs(const Sim& sim) {
  const Pairs& p = sim.pairs;
  p.mesh.bind_storage(BIND_PAIR_MESH), p.spheres.bind_storage(BIND_PAIR_SPHERES);
  p.lists.bind_storage(BIND_PAIR_LISTS), p.sums.bind_storage(BIND_PAIR_SUMS);
  if (p.rest) p.rest.bind_storage(BIND_PAIR_REST);
  glBindBuffer(GL_DISPATCH_INDIRECT_BUFFER, p.lists.id());
}

// Of bodies; of leaves as well, with what is counted for candidates at 0.
void find_boxes(Sim& sim, bool leaves) {
  Pairs& p = sim.pairs;
  glMemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT);
  const std::size_t first = leaves ? 4 * found : 4 * counters;
  p.empty.copy_to(p.lists, first, first, p.empty.bytes() - first);
  p.boxes.work_groups = p.slices + (leaves ? p.leaves : 0);
  run(p.boxes, sim);
}

void find_candidates(Sim& sim, double margin) {
  Pairs& p = sim.pairs;
  p.boxes.program.use();
  p.boxes.program.set("margin", float(margin + p.thickness));
  find_boxes(sim, true);
  run(p.cull, sim);
  glMemoryBarrier(GL_COMMAND_BARRIER_BIT);
  for (Pairs::Kernel* kernel : {&p.query, &p.query_edges}) {
    if (!kernel->counted_by) continue;
    kernel->program.use();
    kernel->program.set("margin", float(margin + p.thickness));
    run(*kernel, sim);
  }
  glMemoryBarrier(GL_COMMAND_BARRIER_BIT);
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
  const auto words = take<std::uint32_t>(p.asked, p.answer, "contacts", true);
  if (!words) return;
  p.touches += (*words)[touching];
  p.depth = double(std::bit_cast<float>((*words)[deepest]));
  p.deepest = std::max(p.deepest, p.depth);
  std::vector<Extent> bodies(sim.model->bodies.size());
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    const std::uint32_t* of_body = &(*words)[counters + box * b];
    Extent& e = bodies[b];
    for (glm::length_t c = 0; c < 3; ++c) {
      const auto at = [&](int k) { return double(unsorted(of_body[k + c])); };
      e.places.low[c] = at(0), e.places.high[c] = at(3), e.speeds.low[c] = at(6), e.speeds.high[c] = at(9);
    }
    e.spread = spreads * double(std::bit_cast<float>(of_body[12]));
  }
  decide(sim, bodies);
}

void ask(Pairs& p) {
  glMemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT);
  p.lists.copy_to(p.answer, 0, 0, p.answer.bytes());
  p.empty.copy_to(p.lists, 4 * touching, 4 * touching, 8);
  p.asked = Fence::here();
}

}  // namespace

Pairs make_pairs(const Model& model, const Settings& settings, const Tuning& tuning,
                 const std::vector<std::string>& vertex_defines) {
  PairMesh surfaces = pair_mesh(model);
  order_in_leaves(model.rest, surfaces);
  add_tets(model.rest, surfaces);
  std::vector<std::uint32_t> words;
  for (const auto& triangle : surfaces.triangles) words.insert(words.end(), triangle.begin(), triangle.end());
  const std::size_t edges_at = words.size();
  for (const auto& [vertex, beside, body] : surfaces.edges)
    words.insert(words.end(), {vertex[0], vertex[1], beside[0], beside[1], body});
  const std::size_t vertices_at = words.size();
  for (const auto& [vertex, body] : surfaces.vertices) words.insert(words.end(), {vertex, body});
  const std::size_t around_at = words.size();
  std::vector<std::vector<std::uint32_t>> around(model.positions.size());
  for (std::uint32_t t = 0; t < surfaces.triangles.size(); ++t)
    for (std::size_t c = 0; c < 3; ++c)
      for (const std::size_t other : {1, 2})
        around[surfaces.triangles[t][c]].push_back(surfaces.triangles[t][(c + other) % 3]);
  std::size_t start = around_at + surfaces.vertices.size() + 1;
  for (const auto& [vertex, body] : surfaces.vertices)
    words.push_back(std::uint32_t(std::exchange(start, start + around[vertex].size())));
  words.push_back(std::uint32_t(start));
  for (const auto& [vertex, body] : surfaces.vertices)
    words.insert(words.end(), around[vertex].begin(), around[vertex].end());
  const std::size_t leaves_at = words.size(), leaves = surfaces.leaves.size();
  for (const auto& [body, triangles, vertices, edges] : surfaces.leaves)
    words.insert(words.end(),
                 {body, triangles[0], triangles[1], vertices[0], vertices[1], edges[0], edges[1]});
  const std::size_t bodies_at = words.size();
  for (std::uint32_t b = 0, leaf = 0; b <= surfaces.thicknesses.size(); ++b) {
    while (leaf < leaves && surfaces.leaves[leaf].body < b) ++leaf;
    const bool there = b < surfaces.thicknesses.size();
    words.insert(words.end(), {std::bit_cast<std::uint32_t>(there ? surfaces.thicknesses[b] : 0), leaf});
  }
  const std::size_t slices_at = words.size();
  constexpr std::size_t slice = 1024;
  for (std::size_t first = 0; first < surfaces.vertices.size();) {
    const std::uint32_t body = surfaces.vertices[first].body;
    std::size_t end = first;
    while (end < surfaces.vertices.size() && end < first + slice && surfaces.vertices[end].body == body)
      ++end;
    words.insert(words.end(), {body, std::uint32_t(first), std::uint32_t(end)});
    first = end;
  }
  const std::size_t behind_at = words.size();
  words.insert(words.end(), surfaces.behind.begin(), surfaces.behind.end());
  const std::size_t tets_at = words.size();
  for (const auto& [v, beyond] : surfaces.tets) {
    words.insert(words.end(), std::begin(v), std::end(v));
    words.insert(words.end(), std::begin(beyond), std::end(beyond));
  }
  const std::size_t slices = (behind_at - slices_at) / 3, triangles = surfaces.triangles.size(),
                    edges = surfaces.edges.size(), vertices = surfaces.vertices.size(),
                    items = vertices + edges, targets = triangles + edges, bodies = model.bodies.size();
  Pairs p;
  p.margin = (settings.contact == "self" ? 1 : 2) * pair_margin(surfaces), p.thickness = surfaces.thickness;
  p.slices = slices, p.leaves = leaves, p.triangles = triangles, p.vertices = vertices, p.items = items;
  p.edges_at = edges_at, p.vertices_at = vertices_at, p.record_words = record;
  p.mesh = Buffer("surfaces", words);
  if (settings.contact == "self") {
    std::vector<glm::vec4> rest;
    for (const glm::dvec3& x : model.rest.positions) rest.emplace_back(glm::vec3(x), 0);
    p.rest = Buffer("surfaces at rest", rest);
  }
  const std::size_t records_at = counters + box * bodies;
  const std::size_t per_group = group / tuning.lanes;
  p.records_at = records_at, p.handed_on = 4 * (records_at + (record + 2) * items);
  p.lists = Buffer("contacts", 4 * (records_at + (record + 3) * items + (2 * per_group + 7) * leaves +
                                    (near_leaves + 1) * leaves + items / per_group + 2 * leaves));
  p.spheres = Buffer("spheres around triangles", 16 * targets);
  p.sums = Buffer("corrections by contacts",
                  std::vector<std::int32_t>((p.sum_words + p.sharing_words) * model.positions.size(), 0),
                  GL_DYNAMIC_COPY);
  std::vector<std::uint32_t> empty(records_at, 0);
  for (const std::size_t three : {groups, lane_groups, query_groups, edge_groups})
    empty[three + 1] = empty[three + 2] = 1;
  for (std::size_t b = 0; b < bodies; ++b)
    for (const std::size_t low : {0, 6}) std::fill_n(&empty[counters + box * b + low], 3, ~0u);
  p.empty = Buffer("no contacts", empty);
  p.answer = Buffer("contacts read-back", 4 * records_at, nullptr, GL_STREAM_READ);
  p.lists.write(0, 4 * records_at, empty.data());

  std::vector<std::string> defines = vertex_defines;
  for (const auto& [name, value] : {std::pair<const char*, std::size_t>{"VERTICES_AT", vertices_at},
                                    {"SLICES_AT", slices_at},
                                    {"SLICES", slices},
                                    {"TRIANGLES", triangles},
                                    {"SURFACE_VERTICES", vertices},
                                    {"EDGES", edges},
                                    {"EDGES_AT", edges_at},
                                    {"BODIES_AT", bodies_at},
                                    {"LEAVES_AT", leaves_at},
                                    {"LEAVES", leaves},
                                    {"CANDIDATES", candidates},
                                    {"NEAR_LEAVES", near_leaves},
                                    {"LANES", tuning.lanes},
                                    {"ROW", tuning.row},
                                    {"AROUND_AT", around_at},
                                    {"BEHIND_AT", behind_at},
                                    {"TETS_AT", tets_at},
                                    {"RECORDS_AT", records_at},
                                    {"GROUP_SIZE", group}})
    defines.push_back(fmt::format("{} {}u", name, value));
  defines.push_back(fmt::format("IMPLICIT {:d}", is_implicit(settings)));
  defines.push_back(fmt::format("SHEETS {:d}", surfaces.thickness > 0));
  defines.push_back(fmt::format("VERTICES {}u", model.positions.size()));
  defines.push_back(fmt::format("EDGE {:.9g}", surfaces.edge));
  defines.push_back(fmt::format("SELF_MARGIN {:.9g}", pair_margin(surfaces)));
  defines.push_back(fmt::format("CONTACT_SELF {}", settings.contact == "self" ? 1 : 0));
  const auto kernel = [&](const char* name, std::size_t work_groups, int counted_by = 0,
                          const char* variant = nullptr) {
    std::vector<std::string> all = defines;
    if (variant) all.push_back(variant);
    return Pairs::Kernel{
        Program::compute(fmt::format("pairs/{}.comp", name), {}, all), work_groups, counted_by, {}};
  };
  p.boxes = kernel("boxes", slices + leaves), p.cull = kernel("cull", leaves);
  p.query = kernel("query", 0, query_groups, "QUERY_EDGES 0");
  if (edges > 0) p.query_edges = kernel("query", 0, edge_groups, "QUERY_EDGES 1");
  p.meet = kernel("meet", 0, lane_groups, "LAGGED 0"), p.push = kernel("push", 0, groups);
  p.lag = contacts_lag(model, settings);
  if (p.lag) p.meet_and_push = kernel("meet", 0, lane_groups, "LAGGED 1");
  return p;
}

void look_around(Sim& sim) {
  Pairs& p = sim.pairs;
  if (!p || sim.steps % Pairs::every != 0) return;
  take_answer(sim);
  bind_pairs(sim);
  sim.positions.bind_storage(BIND_POSITIONS), sim.velocities.bind_storage(BIND_VELOCITIES);
  if (!p.near || p.since < 0) find_boxes(sim, false);
  ask(p);
}

void touch(Sim& sim, int left) {
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
  const double serve =
      std::max(1.0, std::floor(margin / (h * std::max(closing, 0.5 * (p.fastest + gained)) + 1e-30)));
  // Numbers of contacts that share a vertex, where the next substep wants those that this one sees coming.
  const bool ahead = p.lag && sim.plan.substeps > 1, lagged = ahead && left > 0 && p.counted && p.since >= 0;
  if (p.since < 0 || (!lagged && p.counted && (p.phases & PHASE_SHARED_LAST) == 0)) p.sums.clear();
  bind_pairs(sim);
  if (sim.quantized[0]) sim.quantized[sim.read_index].bind_storage(BIND_QUANTIZED_OUT);
  // What folds, or is on its way out of another, soon wants other candidates.
  const bool changes = s.contact == "self" || p.depth > 0.1 * p.margin;
  const long steps = changes ? 1 : Pairs::serve_most;
  if (p.since < 0 || double(p.since) >= std::min(serve, double(steps * sim.plan.substeps)))
    find_candidates(sim, margin);
  ++p.since;
  Pairs::Kernel& meet = lagged ? p.meet_and_push : p.meet;
  for (Program* program : {&meet.program, &p.push.program}) program->use(), program->set("side", p.side);
  meet.program.use();
  meet.program.set("ahead", std::uint32_t(ahead));
  meet.program.set("substep", std::uint32_t(p.since));
  // Corrections of one pass bring things nearer to those of the next.
  meet.program.set(
      "closed_most",
      is_implicit(s) ? 1e30f : float(std::max({closing, p.fastest + gained, margin / (2 * s.dt)}) * h));
  // Implicit substeps are long, so what one pass leaves is much: a stack sinks in by 0.7 % after 1, 0.02
  // after 8.
  for (int pass = 0; pass < (is_implicit(s) ? 8 : 1); ++pass) {
    run(meet, sim);
    if (!lagged) run(p.push, sim);
  }
  p.counted = ahead;
  if (ahead) p.side = 1 - p.side;
  p.phases =
      lagged ? PHASE_TOUCHED | (p.side ? PHASE_SHARED_SIDE : 0u) | (left == 1 ? PHASE_SHARED_LAST : 0u) : 0u;
}

void start_pairs(Sim& sim, const State& state) {
  Pairs& p = sim.pairs;
  if (!p) return;
  p.asked = {}, p.since = -1;
  std::vector<Extent> bodies;
  for (const Body& body : sim.model->bodies) {
    const auto of_body = [&](const std::vector<glm::dvec3>& all) {
      const auto first = all.begin() + std::ptrdiff_t(body.first_vertex);
      return bounds({first, first + std::ptrdiff_t(body.vertices)});
    };
    bodies.push_back({of_body(state.positions), of_body(state.velocities)});
  }
  decide(sim, bodies);
  p.overlap = p.near ? overlap_of(*sim.model, state.positions, sim.settings.contact == "self").deepest : 0;
  std::vector<std::uint32_t> words(p.lists.bytes() / 4, ~0u);  // nothing is held
  p.empty.read(0, p.empty.bytes(), words.data());
  p.lists.write(0, p.lists.bytes(), words.data());
  if (is_implicit(sim.settings) && p.near) set_finer(sim, finer_times);
}

void add_carried(Carried& all, Pairs& p) {
  if (!p) return;
  const std::size_t words = p.sums.bytes() / (p.sum_words + p.sharing_words);  // bytes of one word by vertex
  all.ranges.push_back({&p.lists, 0, p.handed_on}), all.add(p.answer);
  if (p.lag) all.ranges.push_back({&p.sums, Pairs::sum_words * words, Pairs::sharing_words * words});
  all.add_values(static_cast<PairNumbers&>(p));
  all.add_readback(p.asked);
}

PairNumbers touched(Sim& sim) {
  Pairs& p = sim.pairs;
  if (p)
    for (int turn = 0; turn < 2; ++turn) take_answer(sim), ask(p);
  return p;
}

}  // namespace tetpbd
