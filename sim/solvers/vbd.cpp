// Vertex Block Descent (Chen, Liu, Yang and Yuksel 2024; method.md, "Vertex Block Descent"): a substep is a step of
// implicit Euler, in which every vertex by turns goes to the minimum of its own energy, a colour of vertices at a time.
#include <fmt/format.h>

#include <memory>

#include "sim/error.h"
#include "sim/gl/buffer_layout.h"
#include "sim/sim.h"
#include "sim/solvers/colours.h"
#include "sim/solvers/jacobi.h"
#include "sim/solvers/newton_graph.h"

namespace tetpbd {

namespace {

constexpr std::size_t group = 128, lanes = 8;  // invocations of a work-group, and for a vertex

struct Descent {
  Pass ends, sweep;
  std::vector<std::size_t> first;  // member of each colour, and the end
};

// The block Mesh of sweep.comp.
struct DescentMesh {
  BufferLayout layout;
  std::vector<std::byte> contents;
  std::size_t uses = 0;       // of constraints by vertices
  std::size_t tets_at = 0;    // first byte of the rest values of neo-Hookean tets
  std::size_t use_bytes = 0;  // what a sweep reads of constraints, vertex by vertex
};

// The constraints of each vertex, as PACKED_USE of newton/layout.glsl.
Grouped uses_by_vertex(const ConstraintSystem& system, std::size_t vertices) {
  struct Item {
    const ConstraintList* list;
    std::uint32_t kind, number;
  };
  std::vector<Item> items;
  std::uint32_t kind = 0;  // among those present
  for (std::size_t k = 0; k < kind_count; ++k) {
    if (!system.present[k]) continue;
    const ConstraintList& list = system.lists[k];
    if (list.count() >= MOST_CONSTRAINTS)
      throw Error("too many constraints for mode vbd", fmt::format("{} of {}", list.count(), constraint_kinds[k].noun),
                  "use a smaller mesh or another mode", 1);
    for (std::uint32_t c = 0; c < list.count(); ++c) items.push_back({&list, kind, c});
    ++kind;
  }
  return group_by_key(items.size(), vertices, [&](std::size_t n, auto&& emit) {
    const auto ends = items[n].list->ends(items[n].number);
    for (std::uint32_t i = 0; i < ends.size(); ++i) emit(ends[i], PACKED_USE(items[n].number, items[n].kind, i, 0u));
  });
}

DescentMesh make_mesh(const ConstraintSystem& system, const VertexColours& colours) {
  const std::size_t vertices = colours.vertices.size();
  const Grouped by_vertex = uses_by_vertex(system, vertices);
  std::vector<std::uint32_t> first_use = {0}, uses;
  for (const std::uint32_t v : colours.vertices) {
    uses.insert(uses.end(), by_vertex.values.begin() + by_vertex.first[v],
                by_vertex.values.begin() + by_vertex.first[v + 1]);
    first_use.push_back(std::uint32_t(uses.size()));
  }
  DescentMesh mesh;
  mesh.uses = uses.size();
  BufferLayout& layout = mesh.layout;
  std::vector<std::function<void()>> writes;
  const auto add = [&]<class T>(T, const std::string& name, auto values) {
    const Range<T> range = layout.add<T>(name, values.size() * sizeof values[0] / sizeof(T));
    writes.push_back([&mesh, range, values = std::move(values)] { put(mesh.contents, range, values); });
    return range.at;
  };
  add(std::uint32_t(), "members", colours.vertices);
  add(std::uint32_t(), "first_use", std::move(first_use));
  add(std::uint32_t(), "uses", std::move(uses));
  const auto for_each_list = [&](auto&& visit) {
    for (std::size_t k = 0; k < kind_count; ++k)
      if (system.present[k]) visit(k, system.lists[k]);
  };
  for_each_list([&](std::size_t k, const ConstraintList& list) {
    const std::string name = fmt::format("vertices_{}", constraint_kinds[k].name);
    list.arity == 2 ? add(glm::uvec2(), name, list.vertices) : add(glm::uvec4(), name, list.vertices);
    mesh.use_bytes += 4 * list.vertices.size() * std::size_t(list.arity);
  });
  const auto add_floats = [&](const char* what, std::vector<double> ConstraintList::*array) {
    for_each_list([&](std::size_t k, const ConstraintList& list) {
      const std::size_t at = add(float(), fmt::format("{}_{}", what, constraint_kinds[k].name), to_floats(list.*array));
      if (k == std::size_t(index_of<NeoHookean>) && array == &ConstraintList::rest) mesh.tets_at = at;
      mesh.use_bytes += 4 * (list.*array).size() * std::size_t(list.arity);
    });
  };
  add_floats("values", &ConstraintList::rest);
  add_floats("compliances", &ConstraintList::compliance);
  add_floats("dampings", &ConstraintList::damping);
  mesh.contents.resize(layout.bytes);
  for (const auto& write : writes) write();
  return mesh;
}

void sweep_once(Sim& sim, Descent& d, bool last) {
  for (std::size_t c = 0; c + 1 < d.first.size(); ++c) {
    const glm::uvec2 colour(d.first[c], d.first[c + 1]);
    sim.recorder.use(d.sweep.program).set("colour", colour);
    d.sweep.work_groups = work_groups((colour.y - colour.x) * lanes, group);
    run_kernel(sim, d.sweep, PHASE_SOLVE | (last ? PHASE_FINISH : 0u));
  }
}

void run_substep(Sim& sim, Descent& d) {
  run_kernel(sim, d.ends, PHASE_PREDICT, ", predict");
  const double radius = sim.settings.acceleration, squared = radius * radius;
  double chebyshev = 1;  // method.md eq. 43
  for (int sweep = 1; sweep <= sim.plan.iterations; ++sweep) {
    sweep_once(sim, d, sweep == sim.plan.iterations);
    if (radius == 0) continue;
    const Program& ends = sim.recorder.use(d.ends.program);
    ends.set("sweep", unsigned(sweep)), ends.set("chebyshev", float(chebyshev));
    run_kernel(sim, d.ends, PHASE_SOLVE, ", accelerate");
    chebyshev = sweep == 1 ? 2 / (2 - squared) : 4 / (4 - squared * chebyshev);
  }
  run_kernel(sim, d.ends, PHASE_FINISH | sim.pairs.phases, ", finish");
}

}  // namespace

Solver create_vbd_solver(const SolverInput& input) {
  Solver solver;
  const std::size_t vertices = input.model.positions.size();
  solver.quantized_buffers = 1, solver.keeps_prediction = true;
  add_prediction(solver, input);
  add_buffer(solver, input.tuning, "Yielded", Buffer("yielded to gravity", std::vector<float>(vertices, 1)));
  const VertexColours colours = colour_vertices(input.system, vertices);
  DescentMesh mesh = make_mesh(input.system, colours);
  const auto descent = std::make_shared<Descent>();
  const bool accelerated = input.settings.acceleration > 0;
  if (accelerated)
    add_buffer(solver, input.tuning, "Sweeps", Buffer("last sweeps", std::vector<glm::vec4>(2 * vertices)));
  std::vector<std::string> defines = vertex_defines(input);
  defines.insert(defines.end(),
                 {define("GROUP_SIZE", group), fmt::format("LANES {}u", lanes), fmt::format("VERTICES {}u", vertices),
                  fmt::format("USES {}u", mesh.uses), define("ACCELERATED", accelerated),
                  define("COUNT_GUARDS", input.tuning.count_guards)});
  for (std::size_t k = 0; k < kind_count; ++k)
    if (input.system.present[k])
      defines.push_back(fmt::format("COUNT_{} {}u", constraint_kinds[k].name, input.system.lists[k].count()));
  const ShaderWords words{{}, kind_words(input.system)};
  descent->ends = {Program::compute("solvers/vbd/ends.comp", {}, defines), work_groups(vertices, group),
                   vertices * (2 * sizeof(Position) + 2 * sizeof(Velocity) + 16)};
  descent->first = colours.first;
  // Positions of neighbours, of which each use of a constraint reads at most four; the vertex there and back.
  const std::size_t bytes = mesh.use_bytes + 4 * sizeof(Position) * mesh.uses + vertices * (2 * sizeof(Position) + 96);
  descent->sweep = {Program::compute("solvers/vbd/sweep.comp", words, defines), 1,
                    bytes / std::max<std::size_t>(colours.first.size() - 1, 1)};
  add_buffer(solver, input.tuning, "Mesh", Buffer("constraints by vertex", mesh.contents));
  if (any_material(input.settings, yields)) {
    solver.rest_block = "Mesh";
    for (std::uint32_t c = 0; c < input.system.lists[index_of<NeoHookean>].count(); ++c)
      solver.rest_copies.push_back({c, std::uint32_t(mesh.tets_at / sizeof(float) + NeoHookean::row.values * c)});
  }
  solver.predict = [descent, predict = solver.predict](Sim& sim) {
    run_kernel(sim, descent->ends, 0, ", after a change");
    predict(sim);
  };
  solver.substep = [descent](Sim& sim, int) { run_substep(sim, *descent); };
  solver.carried = [](Sim& sim, Carried& all) { all.add(sim.solver.buffers.front()); };
  return solver;
}

}  // namespace tetpbd
