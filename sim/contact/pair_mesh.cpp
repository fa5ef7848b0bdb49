// The surfaces of bodies as contact needs them.
#include <algorithm>
#include <cmath>
#include <tuple>

#include "sim/contact/pairs.h"
#include "sim/model/hilbert.h"

namespace tetpbd {

// The gap that a sheet keeps, as a part of its edges: without one, corners could cut through between its vertices.
constexpr double sheet_gap = 0.2;
// rad. An edge that turns by less can be penetrated between its vertices by at most a fifteenth of its length.
constexpr double sharp = 0.52;

namespace {

void add_sharp_edges(const TetMesh& rest, const Body& body, std::uint32_t number, PairMesh& mesh) {
  struct Half {
    std::uint32_t low, high, from, beside, triangle;
  };
  std::vector<Half> halves;
  std::vector<glm::dvec3> normals;
  for (std::size_t t = 0; t < body.triangles; ++t) {
    const auto& corners = rest.surface[body.first_triangle + t];
    const auto& [i, j, k] = corners;
    const auto& x = rest.positions;
    normals.push_back(glm::cross(x[j] - x[i], x[k] - x[i]));
    for (std::size_t c = 0; c < 3; ++c) {
      const std::uint32_t a = corners[c], b = corners[(c + 1) % 3];
      halves.push_back({std::min(a, b), std::max(a, b), a, corners[(c + 2) % 3], std::uint32_t(t)});
    }
  }
  std::ranges::sort(halves, [](const Half& a, const Half& b) {
    return std::tie(a.low, a.high, a.triangle) < std::tie(b.low, b.high, b.triangle);
  });
  for (std::size_t k = 0; k + 1 < halves.size(); ++k) {
    const Half &a = halves[k], &b = halves[k + 1];
    if (a.low != b.low || a.high != b.high || a.from == b.from) continue;
    const glm::dvec3 &n = normals[a.triangle], &m = normals[b.triangle];
    const bool convex = glm::dot(n, rest.positions[b.beside] - rest.positions[a.from]) < 0;
    if (convex && glm::dot(n, m) < std::cos(sharp) * glm::length(n) * glm::length(m))
      mesh.edges.push_back({{a.from, b.from}, {a.beside, b.beside}, number});
  }
}

}  // namespace

void order_in_leaves(const TetMesh& rest, PairMesh& mesh) {
  constexpr std::size_t most = 64;  // triangles
  const Bounds box = bounds(rest.positions);
  const auto centre = [&](const auto& t) {
    return (rest.positions[t[0]] + rest.positions[t[1]] + rest.positions[t[2]]) / 3.0;
  };
  std::vector<std::pair<std::uint64_t, std::uint32_t>> keys;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t)
    keys.emplace_back(hilbert_key(centre(mesh.triangles[t]), box), t);
  std::ranges::sort(keys, {},
                    [&](const auto& k) { return std::tuple(mesh.triangles[k.second][3], k.first, k.second); });
  auto triangles = mesh.triangles;
  std::vector<std::uint32_t> leaf_at(rest.positions.size(), ~0u);  // the first that has the vertex
  for (std::size_t t = 0; t < keys.size(); ++t) {
    mesh.triangles[t] = triangles[keys[t].second];
    const auto& [i, j, k, body] = mesh.triangles[t];
    if (mesh.leaves.empty() || mesh.leaves.back().body != body || t - mesh.leaves.back().triangles[0] == most)
      mesh.leaves.push_back({body, {std::uint32_t(t), 0}, {0, 0}, {0, 0}});
    mesh.leaves.back().triangles[1] = std::uint32_t(t) + 1;
    for (const std::uint32_t v : {i, j, k}) leaf_at[v] = std::min(leaf_at[v], std::uint32_t(mesh.leaves.size() - 1));
  }
  std::ranges::sort(mesh.vertices, {}, [&](const PairMesh::Item& v) { return std::pair(leaf_at[v.vertex], v.vertex); });
  std::ranges::stable_sort(mesh.edges, {}, [&](const PairMesh::Edge& e) { return leaf_at[e.vertex[0]]; });
  std::size_t v = 0, e = 0;
  for (std::uint32_t l = 0; l < mesh.leaves.size(); ++l) {
    pair_layout::SurfaceLeaf& leaf = mesh.leaves[l];
    leaf.vertices[0] = std::uint32_t(v), leaf.edges[0] = std::uint32_t(e);
    while (v < mesh.vertices.size() && leaf_at[mesh.vertices[v].vertex] == l) ++v;
    while (e < mesh.edges.size() && leaf_at[mesh.edges[e].vertex[0]] == l) ++e;
    leaf.vertices[1] = std::uint32_t(v), leaf.edges[1] = std::uint32_t(e);
  }
}

void add_tets(const TetMesh& rest, PairMesh& mesh) {
  std::vector<char> near(rest.positions.size(), 0);
  for (const auto& [vertex, body] : mesh.vertices) near[vertex] = 1;
  for (char ring = 1; ring < 3; ++ring)  // vertices within two tets of the surface
    for (const Tet& tet : rest.tets)
      if (std::ranges::any_of(tet, [&](std::uint32_t v) { return near[v] > 0 && near[v] <= ring; }))
        for (const std::uint32_t v : tet)
          if (near[v] == 0) near[v] = char(ring + 1);
  std::ranges::copy_if(rest.tets, std::back_inserter(mesh.tets), [&](const Tet& tet) {
    return std::ranges::all_of(tet, [&](std::uint32_t v) { return near[v] > 0; });
  });
  mesh.beyond.assign(mesh.tets.size(), {mesh.none, mesh.none, mesh.none, mesh.none});
  mesh.behind.assign(mesh.triangles.size(), mesh.none);
  struct Face {
    std::array<std::uint32_t, 3> sorted;
    std::uint32_t own;         // its tet, or none for a triangle of the surface
    std::uint32_t* neighbour;  // where to store the tet on its other side
  };
  std::vector<Face> faces;
  const auto add_face = [&](std::array<std::uint32_t, 3> vertices, std::uint32_t own, std::uint32_t& neighbour) {
    std::ranges::sort(vertices);
    faces.push_back({vertices, own, &neighbour});
  };
  for (std::uint32_t t = 0; t < mesh.tets.size(); ++t)
    for (std::size_t k = 0; k < 4; ++k) {
      const Tet& v = mesh.tets[t];
      add_face({v[(k + 1) % 4], v[(k + 2) % 4], v[(k + 3) % 4]}, t, mesh.beyond[t][k]);
    }
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto& [i, j, k, body] = mesh.triangles[t];
    add_face({i, j, k}, mesh.none, mesh.behind[t]);
  }
  std::ranges::sort(faces, {}, &Face::sorted);
  for (std::size_t k = 0; k + 1 < faces.size(); ++k)
    if (const Face& a = faces[k], &b = faces[k + 1]; a.sorted == b.sorted) *a.neighbour = b.own, *b.neighbour = a.own;
}

PairMesh pair_mesh(const Model& model) {
  PairMesh mesh;
  double total_length = 0;
  for (std::uint32_t b = 0; b < model.bodies.size(); ++b) {
    const Body& body = model.bodies[b];
    std::vector<std::uint32_t> vertices;
    double length = 0;  // of one edge of each triangle
    for (std::size_t t = body.first_triangle; t < body.first_triangle + body.triangles; ++t) {
      const auto& [i, j, k] = model.rest.surface[t];
      mesh.triangles.push_back({i, j, k, b});
      vertices.insert(vertices.end(), {i, j, k});
      length += glm::distance(model.rest.positions[i], model.rest.positions[j]);
    }
    total_length += length;
    if (!body.is_sheet()) add_sharp_edges(model.rest, body, b, mesh);
    std::ranges::sort(vertices);
    const auto repeated = std::ranges::unique(vertices);
    vertices.erase(repeated.begin(), repeated.end());
    const double thickness = body.is_sheet() ? sheet_gap * length / double(body.triangles) : 0;
    mesh.thicknesses.push_back(float(thickness));
    for (const std::uint32_t v : vertices) mesh.vertices.push_back({v, b});
    mesh.thickness = std::max(mesh.thickness, thickness);
  }
  mesh.edge = total_length / double(std::max<std::size_t>(mesh.triangles.size(), 1));
  return mesh;
}

}  // namespace tetpbd
