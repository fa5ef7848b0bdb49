#include "sim/model/averages.h"

#include <algorithm>

namespace tetpbd {

namespace {

// The share of a tet's corners in the averages around each of them: corner i with what corner j adds.
struct Share {
  std::uint32_t vertex, neighbour;
  glm::dvec3 own, other;
};

}  // namespace

Averages average_tets(const TetMesh& mesh, double mu, double lambda, double s) {
  Averages result;
  const std::size_t count = mesh.positions.size();
  result.vertices.assign(count, {0, (1 - s) * mu, lambda, 1 + 0.75 * s * mu / lambda});
  std::vector<std::vector<Averages::Part>> parts(count);
  std::vector<Share> shares;
  shares.reserve(12 * mesh.tets.size());
  for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
    const Tet& tet = mesh.tets[t];
    std::array<glm::dvec3, 4> x;
    for (std::size_t i = 0; i < 4; ++i) x[i] = mesh.positions[tet[i]];
    const double six_volumes = glm::determinant(glm::dmat3(x[1] - x[0], x[2] - x[0], x[3] - x[0]));
    const double quarter = six_volumes / 24 * fill_of(mesh, t);
    const std::array<glm::dvec3, 4> gradients = barycentric_gradients(x);
    for (std::size_t i = 0; i < 4; ++i) {
      result.vertices[tet[i]].volume += quarter;
      const auto& [a, b, c] = tet_faces[i];
      parts[tet[i]].push_back({{tet[a], tet[b], tet[c]}, quarter / six_volumes});
      for (std::size_t j = 0; j < 4; ++j)
        if (j != i) shares.push_back({tet[i], tet[j], quarter * gradients[j], quarter * gradients[i]});
    }
  }
  std::ranges::stable_sort(shares, {}, [](const Share& share) { return std::pair(share.vertex, share.neighbour); });
  result.first_neighbour.assign(count + 1, 0), result.first_part.assign(count + 1, 0);
  for (std::size_t k = 0; k < shares.size(); ++k) {
    const Share& share = shares[k];
    const bool same = k > 0 && shares[k - 1].vertex == share.vertex && shares[k - 1].neighbour == share.neighbour;
    if (!same) result.neighbours.push_back({share.neighbour, glm::dvec3(0), glm::dvec3(0)});
    result.neighbours.back().own += share.own, result.neighbours.back().other += share.other;
    result.first_neighbour[share.vertex + 1] = std::uint32_t(result.neighbours.size());
  }
  for (std::size_t v = 0; v < count; ++v) {
    result.first_neighbour[v + 1] = std::max(result.first_neighbour[v + 1], result.first_neighbour[v]);
    result.parts.insert(result.parts.end(), parts[v].begin(), parts[v].end());
    result.first_part[v + 1] = std::uint32_t(result.parts.size());
  }
  return result;
}

void append(Averages& to, const Averages& from, std::size_t vertices, std::uint32_t offset) {
  const auto neighbours = std::uint32_t(to.neighbours.size()), parts = std::uint32_t(to.parts.size());
  to.vertices.resize(offset), to.first_neighbour.resize(offset + 1, neighbours),
      to.first_part.resize(offset + 1, parts);
  to.vertices.insert(to.vertices.end(), from.vertices.begin(), from.vertices.end());
  to.vertices.resize(offset + vertices);
  for (std::size_t v = 1; v < from.first_part.size(); ++v) {
    to.first_neighbour.push_back(neighbours + from.first_neighbour[v]);
    to.first_part.push_back(parts + from.first_part[v]);
  }
  to.first_neighbour.resize(offset + vertices + 1, std::uint32_t(neighbours + from.neighbours.size()));
  to.first_part.resize(offset + vertices + 1, std::uint32_t(parts + from.parts.size()));
  for (Averages::Neighbour n : from.neighbours) n.vertex += offset, to.neighbours.push_back(n);
  for (Averages::Part part : from.parts) {
    for (std::uint32_t& v : part.others) v += offset;
    to.parts.push_back(part);
  }
}

Average average_at(const Averages& averages, std::size_t v, const std::vector<glm::dvec3>& positions) {
  const double volume = averages.vertices[v].volume;
  if (!(volume > 0)) return {};
  const glm::dvec3& x = positions[v];
  Average sum{glm::dmat3(0), 0};
  for (std::uint32_t k = averages.first_neighbour[v]; k < averages.first_neighbour[v + 1]; ++k) {
    const Averages::Neighbour& n = averages.neighbours[k];
    sum.F += glm::outerProduct(positions[n.vertex] - x, n.own);
  }
  for (std::uint32_t k = averages.first_part[v]; k < averages.first_part[v + 1]; ++k) {
    const auto& [a, b, c] = averages.parts[k].others;
    const glm::dvec3 side = positions[a] - x;
    sum.J += averages.parts[k].weight * glm::dot(side, glm::cross(positions[b] - x, positions[c] - x));
  }
  return {sum.F / volume, sum.J / volume};
}

}  // namespace tetpbd
