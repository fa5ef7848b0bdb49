// Which triangles meet at which edges and vertices.
#pragma once

#include <cstdint>
#include <numeric>
#include <utility>
#include <vector>

#include "sim/mesh/tet_mesh.h"

namespace tetpbd {

/// Union-find with path halving, which also tells which members are turned against each other.
struct DisjointSets {
  std::vector<std::uint32_t> parent;
  std::vector<char> turned;  ///< against the parent
  explicit DisjointSets(std::size_t count) : parent(count), turned(count, 0) {
    std::iota(parent.begin(), parent.end(), 0u);
  }
  /// The root of i's set, and whether i is turned against it.
  std::pair<std::uint32_t, bool> root(std::uint32_t i) {
    bool against = false;
    for (; parent[i] != i; i = parent[i]) {
      turned[i] = char(turned[i] ^ turned[parent[i]]);
      parent[i] = parent[parent[i]];
      against ^= turned[i] != 0;
    }
    return {i, against};
  }
  /// False when they are joined already, the other way round.
  bool join(std::uint32_t a, std::uint32_t b, bool against = false) {
    const auto [root_a, turned_a] = root(a);
    const auto [root_b, turned_b] = root(b);
    const bool turn = turned_a ^ turned_b ^ against;
    if (root_a == root_b) return !turn;
    parent[root_a] = root_b;
    turned[root_a] = turn;
    return true;
  }
  std::size_t count() const {
    std::size_t roots = 0;
    for (std::uint32_t i = 0; i < parent.size(); ++i) roots += parent[i] == i;
    return roots;
  }
};

/// One side of a triangle: corner `side` to the next.
struct EdgeUse {
  std::uint32_t low, high;  ///< vertices, low < high
  std::uint32_t triangle;
  std::uint32_t side;
  bool forward;  ///< the triangle runs from low to high
};

struct SurfaceTopology {
  std::vector<EdgeUse> uses;              ///< sorted by (low, high, triangle)
  std::vector<std::uint32_t> edges;       ///< where each edge begins in `uses`, and the end
  std::vector<std::uint32_t> patch;       ///< triangle -> patch: joined across edges that two triangles share
  std::vector<char> turned;               ///< triangle -> whether it is turned against others of its patch
  std::vector<std::uint32_t> one_sided;   ///< edges across which no choice of turns makes neighbours agree
  std::vector<std::uint32_t> fans;        ///< vertex -> number of fans of triangles around it
  std::size_t patches = 0, vertices = 0;  ///< vertices: those with a triangle
  std::size_t edge_count() const { return edges.size() - 1; }
  std::size_t uses_of(std::size_t edge) const { return edges[edge + 1] - edges[edge]; }
};

/// Indices must be in range and no triangle may name a vertex twice.
SurfaceTopology surface_topology(const std::vector<Triangle>& triangles, std::size_t vertex_count);

}  // namespace tetpbd
