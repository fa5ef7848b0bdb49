// Constraints and vertices cut into patches.
#include <doctest/doctest.h>
#include <omp.h>

#include <algorithm>
#include <cmath>

#include "sim/sim.h"
#include "sim/solvers/cpu_pbd.h"
#include "sim/solvers/patches.h"
#include "tests/gl_test.h"

using namespace tetpbd;

namespace {

using Constraint = std::vector<std::uint32_t>;  // kind, vertices

std::shared_ptr<const Model> model_of(const TetMesh& mesh) {
  auto model = std::make_shared<Model>();
  add_body(*model, "body", mesh, 1000, mesh.positions, glm::dvec3(0), glm::dvec3(0), {});
  return model;
}

std::vector<Constraint> given(const ConstraintSystem& system) {
  std::vector<Constraint> all;
  for (std::uint32_t k = 0; k < system.lists.size(); ++k) {
    const ConstraintList& list = system.lists[k];
    for (std::size_t c = 0; c < list.count(); ++c) {
      Constraint& constraint = all.emplace_back(Constraint{k});
      for (int j = 0; j < list.arity; ++j)
        constraint.push_back(list.vertices[c * std::size_t(list.arity) + std::size_t(j)]);
    }
  }
  std::sort(all.begin(), all.end());
  return all;
}

// Also checks what holds for every part.
std::vector<Constraint> of_chunk(const Patches& patches, const ConstraintSystem& system, std::size_t part) {
  const std::uint32_t* words = patches.chunks.data() + part * patches.chunk_words;
  CHECK(patches.largest <= Patches::most_vertices);
  CHECK(words[0] <= patches.largest);
  CHECK(words[1] <= patches.most_owned);
  CHECK(patches.vertices.size() == patches.chunks.size() / patches.chunk_words * patches.largest);
  std::vector<Constraint> all;
  for (std::uint32_t k = 0; k < 3; ++k)
    for (std::uint32_t r = words[4 + 2 * k]; r < words[4 + 2 * k] + words[5 + 2 * k]; ++r) {
      Constraint& constraint = all.emplace_back(Constraint{k});
      for (int j = 0; j < system.lists[k].arity; ++j) {
        const std::uint32_t slot = (patches.records[r][0] >> (8 * j)) & 255;
        REQUIRE(slot < words[0]);
        constraint.push_back(patches.vertices[part * patches.largest + slot][0]);
      }
    }
  return all;
}

// Two vertices and a ring of n around them: n tets, 2n + n + 1 edges, and more neighbours than a part has
// room for.
TetMesh wheel(std::uint32_t n) {
  TetMesh mesh;
  mesh.positions = {{0, 0.5, 0}, {0, -0.4, 0}};
  for (std::uint32_t r = 0; r < n; ++r) {
    const double angle = 2 * 3.14159265358979 * r / n;
    mesh.positions.push_back({std::cos(angle), 0.1 * std::sin(5 * angle), std::sin(angle)});
    mesh.tets.push_back({0, 1, 2 + r, 2 + (r + 1) % n});
  }
  finish_tets(mesh, "wheel");
  return mesh;
}

}  // namespace

TEST_CASE("patches: each constraint in one, on at most 256 vertices") {
  const auto model = model_of(make_block({1, 0.7, 0.5}, {8, 6, 4}));
  const ConstraintSystem system = build_constraints(model->rest, "stretch,bend,volume");
  for (std::size_t most : {1, 50, 5000}) {
    CAPTURE(most);
    const Patches patches = constraint_patches(system, most);
    CHECK(patches.chunks.size() == patches.count * patches.chunk_words);
    std::vector<Constraint> found;
    for (std::size_t p = 0; p < patches.count; ++p) {
      const auto here = of_chunk(patches, system, p);
      CHECK(here.size() <= most);
      CHECK(patches.chunks[p * patches.chunk_words] == patches.chunks[p * patches.chunk_words + 1]);
      found.insert(found.end(), here.begin(), here.end());
    }
    std::sort(found.begin(), found.end());
    CHECK(found == given(system));
  }
}

TEST_CASE("patches: of vertices, with every constraint on these, also where a vertex has too many neighbours") {
  struct Case {
    TetMesh mesh;
    std::size_t own;
    bool chunked;
  };
  omp_set_num_threads(4);
  const Case cases[] = {{make_block({1, 0.7, 0.5}, {8, 6, 4}), 1, false},
                        {make_block({1, 0.7, 0.5}, {8, 6, 4}), 17, false},
                        {make_block({1, 0.7, 0.5}, {8, 6, 4}), 200, false},
                        {wheel(300), 16, true}};
  for (const Case& c : cases) {
    CAPTURE(c.own);
    const auto model = model_of(c.mesh);
    const ConstraintSystem system = build_constraints(model->rest, "stretch,bend,volume");
    const Patches patches = vertex_patches(system, c.own);
    CHECK(patches.chunked == c.chunked);
    std::vector<Constraint> found;
    std::vector<std::vector<Constraint>> at(system.at_vertex.size());  // by vertex, what its patch has of it
    std::vector<float> counted(at.size());
    std::vector<int> times_own(at.size());
    for (std::size_t p = 0; p < patches.count; ++p) {
      bool first = true;
      for (std::size_t part = p; first || part != 0; first = false) {
        const std::uint32_t* words = patches.chunks.data() + part * patches.chunk_words;
        for (std::uint32_t own = 0; own < words[1]; ++own) {
          const auto& vertex = patches.vertices[part * patches.largest + own];
          CHECK(vertex[0] == words[2] + own);
          if (first) ++times_own[vertex[0]];
          counted[vertex[0]] = std::bit_cast<float>(vertex[1]);
        }
        for (const Constraint& constraint : of_chunk(patches, system, part))
          for (std::size_t j = 1; j < constraint.size(); ++j)
            if (constraint[j] - words[2] < words[1]) at[constraint[j]].push_back(constraint);
        part = words[3];
      }
    }
    for (std::size_t v = 0; v < at.size(); ++v) {
      CHECK(times_own[v] == 1);
      CHECK(counted[v] == float(at[v].size()));
      for (const Constraint& constraint : at[v])
        if (constraint[1] == v) found.push_back(constraint);
    }
    std::sort(found.begin(), found.end());
    CHECK(found == given(system));
  }
  omp_set_num_threads(omp_get_num_procs());
}

TEST_CASE("patches: a vertex with too many neighbours for one part is solved as in double") {
  GlTest gl;
  TetMesh mesh = wheel(300);
  auto model = std::make_shared<Model>();
  auto start = mesh.positions;
  for (auto& p : start) p.x *= 1.2, p.y += 2;
  add_body(*model, "wheel", mesh, 1000, start, glm::dvec3(0), glm::dvec3(0), {});
  Settings settings;
  settings.iterations = 25, settings.substeps = 1;
  settings.iterations = 5;
  std::uint64_t bits = 0;
  for (const char* mode : {"constraint", "node"}) {
    settings.mode = mode;
    Sim sim = create_sim(model, settings);
    CpuPbd<double> pbd(*model, sim.system);
    State expected = read_state(sim);
    const State before = expected;
    pbd.step(expected, settings, sim.inverse_masses, Sweep::jacobi);
    step(sim);
    const State after = read_state(sim);
    double worst = 0, moved = 0;
    for (std::size_t i = 0; i < after.positions.size(); ++i) {
      worst = std::max(worst, glm::length(after.positions[i] - expected.positions[i]));
      moved = std::max(moved, glm::length(after.positions[i] - before.positions[i]));
    }
    CHECK(worst < 2e-5);  // thin tets: float formulas are worse at them than at a good mesh
    CHECK(moved > 0.01);
    if (bits != 0) CHECK(state_hash(sim) == bits);
    bits = state_hash(sim);
  }
}
