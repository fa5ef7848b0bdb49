// Surfaces of bodies as contact needs them: triangles, sharp edges and vertices, in leaves.
#include <algorithm>
#include <cmath>
#include <tuple>

#include "sim/contact/pairs.h"
#include "sim/model/hilbert.h"

namespace tetpbd {

// What a sheet keeps from others, as a part of its edges: between its vertices it would cut corners off them.
constexpr double sheet_gap = 0.2;
// rad. An edge that turns by less leaves at most a fifteenth of its length between its vertices.
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
  std::vector<std::uint32_t> leaf_of(rest.positions.size(), ~0u);  // the first that has the vertex
  for (std::size_t t = 0; t < keys.size(); ++t) {
    mesh.triangles[t] = triangles[keys[t].second];
    const auto& [i, j, k, body] = mesh.triangles[t];
    if (mesh.leaves.empty() || mesh.leaves.back().body != body || t - mesh.leaves.back().triangles[0] == most)
      mesh.leaves.push_back({body, {std::uint32_t(t), 0}, {0, 0}, {0, 0}});
    mesh.leaves.back().triangles[1] = std::uint32_t(t) + 1;
    for (const std::uint32_t v : {i, j, k}) leaf_of[v] = std::min(leaf_of[v], std::uint32_t(mesh.leaves.size() - 1));
  }
  std::ranges::sort(mesh.vertices, {}, [&](const PairMesh::Item& v) { return std::pair(leaf_of[v.vertex], v.vertex); });
  std::ranges::stable_sort(mesh.edges, {}, [&](const PairMesh::Edge& e) { return leaf_of[e.vertex[0]]; });
  std::size_t v = 0, e = 0;
  for (std::uint32_t l = 0; l < mesh.leaves.size(); ++l) {
    pair_layout::SurfaceLeaf& leaf = mesh.leaves[l];
    leaf.vertices[0] = std::uint32_t(v), leaf.edges[0] = std::uint32_t(e);
    while (v < mesh.vertices.size() && leaf_of[mesh.vertices[v].vertex] == l) ++v;
    while (e < mesh.edges.size() && leaf_of[mesh.edges[e].vertex[0]] == l) ++e;
    leaf.vertices[1] = std::uint32_t(v), leaf.edges[1] = std::uint32_t(e);
  }
}

void add_tets(const TetMesh& rest, PairMesh& mesh) {
  std::vector<char> near(rest.positions.size(), 0);
  for (const auto& [vertex, body] : mesh.vertices) near[vertex] = 1;
  for (char ring = 1; ring < 3; ++ring)
    for (const Tet& tet : rest.tets)
      if (std::ranges::any_of(tet, [&](std::uint32_t v) { return near[v] > 0 && near[v] <= ring; }))
        for (const std::uint32_t v : tet)
          if (near[v] == 0) near[v] = char(ring + 1);
  struct Face {
    std::array<std::uint32_t, 3> sorted;
    std::uint32_t* value;  // what is beyond it, or behind
    std::uint32_t own;     // tet, or none
  };
  const auto face = [](std::array<std::uint32_t, 3> of, std::uint32_t* value, std::uint32_t own) {
    std::ranges::sort(of);
    return Face{of, value, own};
  };
  for (const Tet& tet : rest.tets)
    if (std::ranges::all_of(tet, [&](std::uint32_t v) { return near[v] > 0; }))
      mesh.tets.push_back({{tet[0], tet[1], tet[2], tet[3]}, {mesh.none, mesh.none, mesh.none, mesh.none}});
  mesh.behind.assign(mesh.triangles.size(), mesh.none);
  std::vector<Face> faces;
  for (std::uint32_t t = 0; t < mesh.tets.size(); ++t) {
    auto& [v, beyond] = mesh.tets[t];
    for (std::size_t k = 0; k < 4; ++k)
      faces.push_back(face({v[(k + 1) % 4], v[(k + 2) % 4], v[(k + 3) % 4]}, &beyond[k], t));
  }
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto& [i, j, k, body] = mesh.triangles[t];
    faces.push_back(face({i, j, k}, &mesh.behind[t], mesh.none));
  }
  std::ranges::sort(faces, {}, &Face::sorted);
  for (std::size_t k = 0; k + 1 < faces.size(); ++k)
    if (faces[k].sorted == faces[k + 1].sorted) *faces[k].value = faces[k + 1].own, *faces[k + 1].value = faces[k].own;
}

PairMesh pair_mesh(const Model& model) {
  PairMesh mesh;
  double length = 0;
  for (std::uint32_t b = 0; b < model.bodies.size(); ++b) {
    const Body& body = model.bodies[b];
    std::vector<std::uint32_t> vertices;
    double across = 0;  // its edges, one of each triangle
    for (std::size_t t = body.first_triangle; t < body.first_triangle + body.triangles; ++t) {
      const auto& [i, j, k] = model.rest.surface[t];
      mesh.triangles.push_back({i, j, k, b});
      vertices.insert(vertices.end(), {i, j, k});
      across += glm::distance(model.rest.positions[i], model.rest.positions[j]);
    }
    length += across;
    if (!body.is_sheet()) add_sharp_edges(model.rest, body, b, mesh);
    std::ranges::sort(vertices);
    const auto rest = std::ranges::unique(vertices);
    vertices.erase(rest.begin(), rest.end());
    const double thickness = body.is_sheet() ? sheet_gap * across / double(body.triangles) : 0;
    mesh.thicknesses.push_back(float(thickness));
    for (const std::uint32_t v : vertices) mesh.vertices.push_back({v, b});
    mesh.thickness = std::max(mesh.thickness, thickness);
  }
  mesh.edge = length / double(std::max<std::size_t>(mesh.triangles.size(), 1));
  return mesh;
}

}  // namespace tetpbd
