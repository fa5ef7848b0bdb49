// Implicit steps: BDF2, a Newton step for each, by conjugate gradients with a preconditioner of two levels
// (method.md, "Implicit steps").
#include <fmt/format.h>

#include <bit>
#include <cmath>

#include "sim/error.h"
#include "sim/parallel.h"
#include "sim/solvers/aggregates.h"
#include "sim/solvers/solver.h"

namespace tetpbd {

namespace {

constexpr unsigned lanes = 4;       // of a row of the matrix
constexpr unsigned row_lanes = 32;  // of one of the coarse matrix
constexpr unsigned slots = 13;      // vectors by vertex, as newton.glsl lists them
enum Passes : std::size_t {
  predict,
  start,
  linearise,
  residual,
  update,
  coarse,
  prolong,
  product,
  finish,
  momentum
};

// A use of a constraint by an edge of the matrix (its vertices' pairs): as shaders have it.
struct Use {
  std::uint64_t edge;  // first vertex << 32 | second
  std::uint32_t entry;
  auto operator<=>(const Use&) const = default;
};

struct Graph {
  std::vector<Use> uses;               // in order
  std::vector<std::uint32_t> edges;    // first use of each, and the end
  Grouped neighbours;                  // of each vertex
  std::vector<std::uint32_t> edge_of;  // by neighbour: edge * 2 + 1 where the vertex is its second
  std::size_t edge_count() const { return edges.size() - 1; }
  std::uint32_t first(std::size_t e) const { return std::uint32_t(uses[edges[e]].edge >> 32); }
  std::uint32_t second(std::size_t e) const { return std::uint32_t(uses[edges[e]].edge); }
};

Graph graph_of(const ConstraintSystem& system, std::size_t vertices) {
  Graph graph;
  std::size_t total = 0;
  for (const ConstraintList& list : system.lists)
    total += list.count() * std::size_t(list.arity * (list.arity - 1) / 2);
  graph.uses.resize(total);
  std::size_t begin = 0;
  std::uint32_t kind = 0;  // among those present
  for (std::size_t k = 0; k < kind_count; ++k) {
    if (!system.present[k]) continue;
    const ConstraintList& list = system.lists[k];
    const std::size_t arity = std::size_t(list.arity), pairs = arity * (arity - 1) / 2;
    if (list.count() >= std::size_t(1) << 25)
      throw Error("too many constraints for mode newton",
                  fmt::format("{} of {}", list.count(), constraint_kinds[k].noun),
                  "use a smaller mesh or another mode", 1);
    parallel_for(list.count(), [&](std::size_t c) {
      Use* use = &graph.uses[begin + pairs * c];
      const auto ends = list.ends(c);
      for (std::uint32_t i = 0; i < arity; ++i)
        for (std::uint32_t j = i + 1; j < arity; ++j) {
          const bool turned = ends[i] > ends[j];
          const std::uint32_t low = turned ? j : i, high = turned ? i : j;
          *use++ = {std::uint64_t(ends[low]) << 32 | ends[high],
                    std::uint32_t(c) << 7 | kind << 4 | low << 2 | high};
        }
    });
    begin += pairs * list.count(), ++kind;
  }
  parallel_sort(std::span(graph.uses));
  for (std::size_t u = 0; u < graph.uses.size(); ++u)
    if (u == 0 || graph.uses[u].edge != graph.uses[u - 1].edge) graph.edges.push_back(std::uint32_t(u));
  graph.edges.push_back(std::uint32_t(graph.uses.size()));
  const auto at_vertex = group_by_key(graph.edge_count(), vertices, [&](std::size_t e, auto&& emit) {
    emit(graph.first(e), std::uint32_t(2 * e));
    emit(graph.second(e), std::uint32_t(2 * e + 1));
  });
  graph.edge_of = at_vertex.values;
  graph.neighbours = at_vertex;
  for (std::uint32_t& v : graph.neighbours.values) v = v % 2 ? graph.first(v / 2) : graph.second(v / 2);
  return graph;
}

// A constraint's block of the matrix at rest, as element_N.glsl has it.
template <class Kind>
glm::dmat3 block_at_rest(const SolverInput& input, const ConstraintList& list, std::size_t c, int i, int j,
                         double h) {
  constexpr std::size_t arity = std::size_t(Kind::row.arity);
  const Settings& settings = input.settings;
  std::array<glm::dvec3, arity> x;
  for (std::size_t k = 0; k < arity; ++k) x[k] = input.model.rest.positions[list.ends(c)[k]];
  const double* rest = &list.rest[c * std::size_t(Kind::row.values)];
  if constexpr (Kind::row.components == 2) {
    return Formulas<double>{}.neo_hookean_part(x.data(), rest, &list.compliance[2 * c], i, j).block;
  } else {
    const double a = list.compliance.empty() ? settings.compliance[index_of<Kind>] : list.compliance[c];
    const double held = (Kind::row.rate ? 0 : 1) + (Kind::row.rate ? 1 : settings.constraint_damping) / h;
    const auto value = Kind::template evaluate<double>(x.data(), rest_of<Kind>(rest));
    return held / a * glm::outerProduct(value.gradient[i], value.gradient[j]);
  }
}

std::vector<glm::dmat3> blocks_at_rest(const SolverInput& input, const Graph& graph, double h) {
  std::vector<glm::dmat3> of_edge(graph.edge_count(), glm::dmat3(0)), blocks(graph.edge_of.size());
  parallel_for(
      of_edge.size(),
      [&](std::size_t e) {
        for (std::uint32_t u = graph.edges[e]; u < graph.edges[e + 1]; ++u) {
          const std::uint32_t entry = graph.uses[u].entry;
          std::uint32_t kind = (entry >> 4) & 7;
          for_each_kind([&](auto row, int k) {
            if (input.system.present[std::size_t(k)] && kind-- == 0)
              of_edge[e] +=
                  block_at_rest<decltype(row)>(input, input.system.lists[std::size_t(k)], entry >> 7,
                                               int((entry >> 2) & 3), int(entry & 3), h);
          });
        }
      },
      1024);
  parallel_for(blocks.size(), [&](std::size_t n) {
    const glm::dmat3& block = of_edge[graph.edge_of[n] / 2];
    blocks[n] = graph.edge_of[n] % 2 ? glm::transpose(block) : block;
  });
  return blocks;
}

// Enough to carry what 3x3 blocks alone do not in a few iterations, and few enough to invert.
std::size_t aggregates_for(std::size_t vertices) {
  return std::size_t(std::clamp(1.3 * std::sqrt(double(vertices)), 1.0, double(most_aggregates)));
}

std::vector<Dispatch> schedule(int iterations, bool free) {
  std::vector<Dispatch> dispatches = {{predict, 0}, {start, 0}, {linearise, 0}, {residual, 0}};
  for (unsigned k = 0; k < unsigned(iterations); ++k) {
    for (const std::size_t pass : {update, coarse, prolong}) dispatches.push_back({pass, k});
    dispatches.push_back({product, k + 1});
  }
  if (free && iterations > 0) dispatches.push_back({momentum, unsigned(iterations)});
  dispatches.push_back({finish, unsigned(iterations)});
  return dispatches;
}

// Words of a storage buffer, and where each list in it begins.
struct Words {
  std::vector<std::uint32_t> all{};
  std::vector<std::string> defines{};
  template <class T>
  void add(const std::string& name, const T& list) {
    defines.push_back(fmt::format("{} {}", name, all.size()));
    all.insert(all.end(), list.begin(), list.end());
  }
};

std::vector<std::uint32_t> records_of(const ConstraintList& list, std::size_t words) {
  std::vector<std::uint32_t> records(list.count() * words);
  parallel_for(list.count(), [&](std::size_t c) {
    std::uint32_t* record = std::ranges::copy(list.ends(c), &records[c * words]).out;
    for (const auto* from : {&list.rest, &list.compliance}) {
      const std::size_t each = from->size() / list.count();
      for (std::size_t k = 0; k < each; ++k)
        *record++ = std::bit_cast<std::uint32_t>(float((*from)[c * each + k]));
    }
  });
  return records;
}

// Where a kind's records begin, and how long each is.
struct Records {
  std::size_t kind, at, words;
};

Words mesh_words(const ConstraintSystem& system, const Graph& graph, const Aggregates& aggregates,
                 std::vector<Records>& found) {
  Words words;
  std::vector<std::uint32_t> entries, neighbours, weights;
  for (const Use& use : graph.uses) entries.push_back(use.entry);
  for (std::size_t n = 0; n < graph.edge_of.size(); ++n)
    neighbours.insert(neighbours.end(), {graph.edge_of[n], graph.neighbours.values[n]});
  for (const auto& shares : aggregates.of_vertex)
    for (const Share& share : shares) weights.push_back(share.aggregate << 16 | share.weight);
  words.add("EDGES_AT", graph.edges);
  words.add("ENTRIES_AT", entries);
  words.add("ROWS_AT", graph.neighbours.first);
  words.add("NEIGHBOURS_AT", neighbours);
  words.add("WEIGHTS_AT", weights);
  words.add("AGGREGATES_AT", aggregates.members.first);
  std::vector<std::uint32_t> members;
  for (const std::uint32_t m : aggregates.members.values)
    members.insert(members.end(), {m / 4, aggregates.of_vertex[m / 4][m % 4].weight});
  words.add("MEMBERS_AT", members);
  for (std::size_t k = 0; k < kind_count; ++k) {
    if (!system.present[k]) continue;
    const ConstraintList& list = system.lists[k];
    const std::string name = constraint_kinds[k].name;
    const std::size_t each = std::size_t(list.arity + constraint_kinds[k].values +
                                         (list.compliance.empty() ? 0 : constraint_kinds[k].components));
    found.push_back({k, words.all.size(), each});
    words.add("RECORDS_" + name, records_of(list, each));
    words.defines.push_back(fmt::format("WORDS_{} {}u", name, each));
    words.defines.push_back(fmt::format("COUNT_{} {}u", name, list.count()));
  }
  return words;
}

// What stays when forces or the length of a substep change.
struct Levels {
  Graph graph;
  Aggregates aggregates;
};

std::vector<glm::vec4> coarse_words(const SolverInput& input, const Levels& levels) {
  const auto& [graph, aggregates] = levels;
  const double h = input.plan.h * 2 / 3;  // BDF2's
  std::vector<double> inertia;
  for (const double w : input.model.inverse_masses) inertia.push_back(w > 0 ? 1 / (w * h * h) : 0);
  const std::vector<glm::dmat3> blocks = blocks_at_rest(input, graph, h);
  const std::vector<float> inverse =
      coarse_inverse(input.model, aggregates, {graph.neighbours, inertia, blocks});
  std::vector<glm::vec4> words(inverse.size() / 4);
  for (std::size_t k = 0; k < inverse.size(); ++k) words[k / 4][glm::length_t(k % 4)] = inverse[k];
  for (const Aggregate& a : aggregates.all) words.emplace_back(glm::vec3(a.centre), float(a.reach));
  return words;
}

}  // namespace

Solver create_newton_solver(const SolverInput& input) {
  const std::size_t vertices = input.model.positions.size();
  Graph edges = graph_of(input.system, vertices);
  Aggregates parts = make_aggregates(input.model, edges.neighbours, aggregates_for(vertices));
  const auto levels = std::make_shared<const Levels>(std::move(edges), std::move(parts));
  const auto& [graph, aggregates] = *levels;
  const std::vector<glm::vec4> second = coarse_words(input, *levels);
  std::vector<Records> records;
  Words mesh = mesh_words(input.system, graph, aggregates, records);

  std::vector<std::uint32_t> free;  // first vertex and the end of each body that nothing holds
  std::vector<float> free_number(vertices, 0);
  std::size_t largest = 0;
  for (const Body& body : input.model.bodies) {
    const auto begin = input.model.inverse_masses.begin() + std::ptrdiff_t(body.first_vertex);
    if (std::any_of(begin, begin + std::ptrdiff_t(body.vertices), [](double w) { return w == 0; })) continue;
    largest = std::max(largest, body.vertices);
    free.insert(free.end(),
                {std::uint32_t(body.first_vertex), std::uint32_t(body.first_vertex + body.vertices)});
    const float number = std::bit_cast<float>(std::uint32_t(free.size() / 2));
    std::fill_n(free_number.begin() + std::ptrdiff_t(body.first_vertex), body.vertices, number);
  }
  mesh.add("BODIES_AT", free);
  std::vector<glm::vec4> vectors(slots * vertices, glm::vec4(0));
  for (std::size_t v = 0; v < vertices; ++v)
    vectors[(slots - 1) * vertices + v] = glm::vec4(glm::vec3(input.model.rest.positions[v]), free_number[v]);
  const unsigned group = std::max(tuned({0, 128}, input.tuning).group, row_lanes), rows = group / lanes;
  const std::size_t count = aggregates.all.size(), unknowns = 6 * count, turns = (vertices + rows - 1) / rows;
  const std::size_t bodies = free.size() / 2, slices = std::clamp<std::size_t>(largest / 256, 1, 32);
  std::size_t tests = 0;  // of constraints at Newton's start
  for (std::size_t k = 0; k < kind_count; ++k)
    if (constraint_kinds[k].tet) tests = std::max(tests, input.system.lists[k].count());

  Solver solver;
  add_buffer(solver, input.tuning, BIND_NEWTON_VECTORS, Buffer("vectors", vectors, GL_DYNAMIC_COPY));
  add_buffer(solver, input.tuning, BIND_NEWTON_BLOCKS,
             Buffer("matrix", std::max<std::size_t>(48 * graph.edge_count(), 48)));
  add_buffer(solver, input.tuning, BIND_NEWTON_MESH, Buffer("constraints and edges", mesh.all));
  add_buffer(solver, input.tuning, BIND_NEWTON_COARSE, Buffer("coarse matrix", second));
  add_buffer(solver, input.tuning, BIND_NEWTON_SUMS,
             Buffer("sums",
                    std::vector<float>(4 + 2 * turns + 8 + 3 * unknowns + 5 * count + 2 +
                                       (13 + 1 + 20 * slices) * bodies),
                    GL_DYNAMIC_COPY));
  solver.handed_on = {{0, 2 * 16 * vertices, 2 * 16 * vertices},  // WAY and GAIN (newton.glsl)
                      {4, 0, solver.buffers[4].bytes()}};         // rotations, among others
  std::vector<std::string> defines = std::move(mesh.defines);
  for (const auto& [name, value] : {std::pair<const char*, std::size_t>{"GROUP_SIZE", group},
                                    {"LANES", lanes},
                                    {"ROW_LANES", row_lanes},
                                    {"VERTICES", vertices},
                                    {"EDGES", graph.edge_count()},
                                    {"TETS", tests},
                                    {"AGGREGATES", count},
                                    {"PRODUCT_GROUPS", turns},
                                    {"FREE_BODIES", bodies},
                                    {"PARTS", slices},
                                    {"COARSE_ROW", (unknowns + 3) / 4},
                                    {"CENTRES_AT", unknowns * ((unknowns + 3) / 4)}})
    defines.push_back(fmt::format("{} {}u", name, value));
  defines.push_back(fmt::format("SHAPES {}", input.model.shapes.size()));
  defines.push_back(fmt::format("FIELDS {:d}", has_fields(input.model)));
  const ShaderWords words{{}, kind_words(input.system)};
  const auto pass = [&](const char* name, std::size_t work_groups, std::size_t bytes) {
    return Pass{Program::compute(fmt::format("newton/{}.comp", name), words, defines),
                std::max<std::size_t>(work_groups, 1), bytes};
  };
  const auto groups = [&](std::size_t items) { return (items + group - 1) / group; };
  const std::size_t vector = 16 * vertices, matrix = 2 * 56 * graph.edge_count();
  solver.begin = pass("begin", groups(std::max(vertices, count)), 2 * vector);
  solver.iteration.push_back(pass("predict", groups(vertices), 12 * vector));
  solver.iteration.push_back(pass("start", count + groups(tests), 4 * 80 * tests));
  solver.iteration.push_back(
      pass("linearise", groups(graph.edge_count()), 48 * graph.edge_count() + 4 * graph.uses.size() * 30));
  solver.iteration.push_back(pass("residual", turns, matrix + 9 * vector));
  solver.iteration.push_back(pass("update", count + groups(vertices), 15 * vector));
  solver.iteration.push_back(
      pass("coarse", (row_lanes * unknowns + group - 1) / group, 4 * unknowns * unknowns));
  solver.iteration.push_back(pass("prolong", groups(vertices), 7 * vector));
  solver.iteration.push_back(pass("product", turns, matrix + 4 * vector));
  solver.iteration.push_back(pass("finish", groups(vertices), 14 * vector));
  if (bodies > 0) solver.iteration.push_back(pass("momentum", slices * bodies, 7 * vector));
  solver.schedule =
      bodies > 0 ? +[](int k) { return schedule(k, true); } : +[](int k) { return schedule(k, false); };
  solver.renewable = 3;
  solver.renewed = [levels](const SolverInput& now) -> MakeWords {
    return [levels, &model = now.model, system = now.system, settings = now.settings, plan = now.plan] {
      return coarse_words({model, system, settings, plan, {}}, *levels);
    };
  };
  solver.take_numbers = [records](const Solver& made, const ConstraintSystem& system) {
    for (const auto& [kind, at, words] : records) {
      const std::vector<std::uint32_t> now = records_of(system.lists[kind], words);
      made.buffers[2].write(4 * at, 4 * now.size(), now.data());
    }
  };
  return solver;
}

}  // namespace tetpbd
