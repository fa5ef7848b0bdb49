// Loops on several cores: every item once, and the same bits for any number of threads.
#include <doctest/doctest.h>

#include <numeric>
#include <stdexcept>

#include "sim/model/hilbert.h"
#include "sim/model/model.h"
#include "sim/parallel.h"
#include "sim/solvers/patches.h"

using namespace tetpbd;

namespace {

constexpr unsigned counts[] = {1, 2, 3, 8};

struct Threads {
  explicit Threads(unsigned count) { omp_set_num_threads(int(count)); }
  ~Threads() { omp_set_num_threads(omp_get_num_procs()); }
};

// Enough tets for several threads in each loop; stretched unevenly, so that no two rest values are alike.
Model block_model() {
  TetMesh mesh = make_block({1, 2, 3}, {24, 25, 45});
  for (glm::dvec3& p : mesh.positions) p += 0.003 * glm::sin(glm::dvec3(90.0 * p.z, 80.0 * p.x, 70.0 * p.y));
  Model model;
  add_body(model, "block", mesh, 1000, mesh.positions, {}, {}, {}, {});
  renumber(model);
  return model;
}

}  // namespace

TEST_CASE("parallel: each item once, and the first failure is thrown") {
  for (const unsigned count : counts) {
    const Threads threads(count);
    CAPTURE(count);
    for (const std::size_t items : {0, 1, 7, 1000}) {
      std::vector<int> visits(items);
      parallel_parts(items, 3, [&](std::size_t first, std::size_t end) {
        for (std::size_t i = first; i < end; ++i) ++visits[i];
      });
      CHECK(std::count(visits.begin(), visits.end(), 1) == std::ptrdiff_t(items));
    }
    const auto fail = [](std::size_t, std::size_t end) { throw std::runtime_error(end == 100 ? "last" : "part"); };
    CHECK_THROWS_WITH(parallel_parts(100, 1, fail), count == 1 ? "last" : "part");
  }
}

TEST_CASE("parallel: sorting and grouping do not depend on threads") {
  std::vector<std::uint64_t> items(100003);
  for (std::size_t i = 0; i < items.size(); ++i) items[i] = i * 0x9e3779b97f4a7c15 % 1000000007;
  std::vector<std::uint64_t> wanted = items;
  std::sort(wanted.begin(), wanted.end());
  for (const unsigned count : counts) {
    const Threads threads(count);
    CAPTURE(count);
    std::vector<std::uint64_t> sorted = items;
    parallel_sort(std::span(sorted));
    CHECK(sorted == wanted);
    const Grouped groups = group_by_key(300000, 7, [](std::size_t i, const auto& emit) {
      if (i % 3) emit(std::uint32_t(i % 7), std::uint32_t(i));
    });
    CHECK(groups.values.size() == 200000);
    for (std::size_t key = 0; key < 7; ++key)
      for (std::uint32_t at = groups.first[key]; at < groups.first[key + 1]; ++at)
        if (groups.values[at] % 7 != key || (at > groups.first[key] && groups.values[at] <= groups.values[at - 1]))
          FAIL("not grouped in order");
  }
}

TEST_CASE("parallel: what a comparison throws while sorting reaches the caller") {
  struct Item {
    int value;
    bool operator<(const Item& other) const {
      if (value == 150000) throw std::runtime_error("no order");
      return value < other.value;
    }
  };
  std::vector<Item> items;
  for (int i = 0; i < 200001; ++i) items.push_back({i});
  for (const unsigned count : counts) {
    const Threads threads(count);
    CHECK_THROWS_WITH(parallel_sort(std::span(items)), "no order");
  }
}

TEST_CASE("parallel: models, constraints, patches and reports have the same bits for any number of threads") {
  omp_set_num_threads(1);
  const Model model = block_model();
  const ConstraintSystem system = build_constraints(model.rest, "stretch,bend,volume");
  const Patches by_vertex = vertex_patches(system, 64), crowded = vertex_patches(system, 250),
                by_constraint = constraint_patches(system, 256);
  const MeshReport r = report(model.rest);
  const auto same = [](const Patches& a, const Patches& b) {
    CHECK(a.count == b.count);
    CHECK(a.largest == b.largest);
    CHECK(a.most_owned == b.most_owned);
    CHECK(a.chunked == b.chunked);
    CHECK((a.chunks == b.chunks && a.vertices == b.vertices && a.records == b.records));
  };
  for (const unsigned count : {2u, 3u, 8u}) {
    const Threads threads(count);
    CAPTURE(count);
    const Model again = block_model();
    CHECK(again.original == model.original);
    CHECK((again.rest.tets == model.rest.tets && again.masses == model.masses));
    const ConstraintSystem built = build_constraints(again.rest, "stretch,bend,volume");
    for (std::size_t k = 0; k < system.lists.size(); ++k) {
      CHECK((built.lists[k].vertices == system.lists[k].vertices));
      CHECK((built.lists[k].rest == system.lists[k].rest));
    }
    same(vertex_patches(built, 64), by_vertex);
    same(vertex_patches(built, 250), crowded);
    same(constraint_patches(built, 256), by_constraint);
    const MeshReport now = report(again.rest);
    CHECK(now.volume == r.volume);
    CHECK(now.mean_min_dihedral_deg == r.mean_min_dihedral_deg);
    CHECK(now.edges == r.edges);
  }
}
