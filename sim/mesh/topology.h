// Which triangles meet at which edges and vertices.
#pragma once

#include <cstdint>
#include <numeric>
#include <vector>

#include "sim/mesh/tet_mesh.h"

namespace tetpbd {

/// Union-find with path halving.
struct DisjointSets {
  std::vector<std::uint32_t> parent;
  explicit DisjointSets(std::size_t count) : parent(count) { std::iota(parent.begin(), parent.end(), 0u); }
  std::uint32_t root(std::uint32_t i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
  }
  void join(std::uint32_t a, std::uint32_t b) { parent[root(a)] = root(b); }
};

/// One side of a triangle: from corner `side` to the next.
struct EdgeUse {
  std::uint32_t low, high;  ///< vertices, low < high
  std::uint32_t triangle, side;
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
