#include "sim/measure/crossings.h"

#include <algorithm>
#include <boost/multiprecision/cpp_int.hpp>
#include <cmath>

#include "sim/contact/cell_grid.h"
#include "sim/parallel.h"

namespace tetpbd {

namespace {

int exact_orientation(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c, const glm::dvec3& d) {
  using Exact = boost::multiprecision::cpp_rational;
  std::array<std::array<Exact, 3>, 3> s;
  for (int k = 0; k < 3; ++k) {
    s[0][std::size_t(k)] = Exact(b[k]) - Exact(a[k]);
    s[1][std::size_t(k)] = Exact(c[k]) - Exact(a[k]);
    s[2][std::size_t(k)] = Exact(d[k]) - Exact(a[k]);
  }
  const Exact volume = s[0][0] * (s[1][1] * s[2][2] - s[1][2] * s[2][1]) +
                       s[0][1] * (s[1][2] * s[2][0] - s[1][0] * s[2][2]) +
                       s[0][2] * (s[1][0] * s[2][1] - s[1][1] * s[2][0]);
  return volume.sign();
}

struct Triangles {
  const Model& model;
  const std::vector<glm::dvec3>& x;
  std::vector<std::uint32_t> body;  // by triangle
  std::vector<Bounds> boxes;

  const glm::dvec3& corner(std::uint32_t t, std::size_t c) const { return x[model.rest.surface[t][c % 3]]; }
  bool can_move(std::uint32_t t) const {
    return std::ranges::any_of(model.rest.surface[t], [&](std::uint32_t v) { return model.inverse_masses[v] > 0; });
  }
  bool are_joined(std::uint32_t a, std::uint32_t b) const {
    return std::ranges::any_of(model.rest.surface[a], [&](std::uint32_t v) {
      return std::ranges::find(model.rest.surface[b], v) != model.rest.surface[b].end();
    });
  }
};

// How far the nearer end of an edge of `a` that passes through `b` is from b's plane, m; none: no edge does.
std::optional<double> find_depth(const Triangles& all, std::uint32_t a, std::uint32_t b) {
  const std::array<glm::dvec3, 3> o{all.corner(b, 0), all.corner(b, 1), all.corner(b, 2)};
  std::array<int, 3> side;
  for (std::size_t c = 0; c < 3; ++c) side[c] = orientation(o[0], o[1], o[2], all.corner(a, c));
  std::optional<double> depth;
  for (std::size_t c = 0; c < 3; ++c) {
    if (side[c] * side[(c + 1) % 3] >= 0) continue;
    const glm::dvec3 &p = all.corner(a, c), &q = all.corner(a, c + 1);
    const std::array<int, 3> turn{orientation(p, q, o[0], o[1]), orientation(p, q, o[1], o[2]),
                                  orientation(p, q, o[2], o[0])};
    if (std::ranges::min(turn) < 0 && std::ranges::max(turn) > 0) continue;
    const glm::dvec3 n = glm::normalize(glm::cross(o[1] - o[0], o[2] - o[0]));
    const double near = std::min(std::abs(glm::dot(p - o[0], n)), std::abs(glm::dot(q - o[0], n)));
    depth = std::max(depth.value_or(0), near);
  }
  return depth;
}

// The mean of the lengths of both triangles' edges.
double edge_length(const Triangles& all, std::uint32_t a, std::uint32_t b) {
  double sum = 0;
  for (const std::uint32_t t : {a, b})
    for (std::size_t c = 0; c < 3; ++c) sum += glm::distance(all.corner(t, c), all.corner(t, c + 1));
  return sum / 6;
}

Triangles lay_out(const Model& model, const std::vector<glm::dvec3>& x) {
  Triangles all{model, x, {}, {}};
  for (std::uint32_t b = 0; b < model.bodies.size(); ++b) all.body.insert(all.body.end(), model.bodies[b].triangles, b);
  for (const auto& [i, j, k] : model.rest.surface)
    all.boxes.push_back({glm::min(x[i], glm::min(x[j], x[k])), glm::max(x[i], glm::max(x[j], x[k]))});
  return all;
}

}  // namespace

Crossings largest(const Crossings& a, const Crossings& b) {
  Crossings result = a.pairs < b.pairs ? b : a;
  result.depth = std::max(a.depth, b.depth);
  return result;
}

int orientation(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c, const glm::dvec3& d) {
  const glm::dvec3 s = b - a, t = c - a, u = d - a;
  const glm::dvec3 n(t.y * u.z - t.z * u.y, t.z * u.x - t.x * u.z, t.x * u.y - t.y * u.x);
  const glm::dvec3 size(std::abs(t.y * u.z) + std::abs(t.z * u.y), std::abs(t.z * u.x) + std::abs(t.x * u.z),
                        std::abs(t.x * u.y) + std::abs(t.y * u.x));
  const double volume = glm::dot(s, n);
  // Shewchuk 1997: what rounding can amount to, eight times 2^-53 of the sum of all products without their signs.
  const double doubt = 8.9e-16 * glm::dot(glm::abs(s), size);
  if (std::abs(volume) > doubt) return volume > 0 ? 1 : -1;
  for (const glm::dvec3& p : {a, b, c, d})
    if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z)) return 0;
  return exact_orientation(a, b, c, d);
}

Crossings find_crossings(const Model& model, const std::vector<glm::dvec3>& x, bool self) {
  const Triangles all = lay_out(model, x);
  std::vector<Bounds> bodies;
  for (const Body& body : model.bodies) bodies.push_back(body_bounds(body, x));
  double length = 0;
  for (const Bounds& box : all.boxes) length += box.size();
  CellGrid grid(std::max(length / double(std::max<std::size_t>(all.boxes.size(), 1)), 1e-9));
  for (std::uint32_t t = 0; t < all.boxes.size(); ++t) {
    bool near = self;
    for (std::size_t b = 0; b < bodies.size() && !near; ++b)
      near = b != all.body[t] && !are_apart(all.boxes[t], bodies[b]);
    if (near) grid.add(all.boxes[t], t);
  }
  std::vector<Crossings> found(all.boxes.size());
  parallel_for(found.size(), 64, [&](std::size_t own) {
    const auto t = std::uint32_t(own);
    std::vector<std::uint32_t> near;
    grid.for_each(all.boxes[t], [&](std::uint32_t o) {
      if (o > t && (self || all.body[o] != all.body[t]) && !are_apart(all.boxes[t], all.boxes[o])) near.push_back(o);
    });
    std::ranges::sort(near);
    const auto same = std::ranges::unique(near);
    near.erase(same.begin(), same.end());
    for (const std::uint32_t o : near) {
      if (all.are_joined(t, o) || !(all.can_move(t) || all.can_move(o))) continue;
      const auto forth = find_depth(all, t, o), back = find_depth(all, o, t);
      if (!forth && !back) continue;
      if (found[t].pairs++ == 0) found[t].first = {t, o};
      found[t].depth = std::max(found[t].depth, std::max(forth.value_or(0), back.value_or(0)) / edge_length(all, t, o));
    }
  });
  Crossings result;
  for (const Crossings& each : found) {
    if (result.pairs == 0) result.first = each.first;
    result.pairs += each.pairs, result.depth = std::max(result.depth, each.depth);
  }
  return result;
}

}  // namespace tetpbd
