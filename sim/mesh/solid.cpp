#include "sim/mesh/solid.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

namespace tetpbd {
namespace {

// Ericson 2005, 5.1.5.
glm::dvec3 nearest_in_triangle(const glm::dvec3& p, const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c) {
  const glm::dvec3 ab = b - a, ac = c - a, ap = p - a, bp = p - b, cp = p - c;
  const double d1 = glm::dot(ab, ap), d2 = glm::dot(ac, ap);
  if (d1 <= 0 && d2 <= 0) return a;
  const double d3 = glm::dot(ab, bp), d4 = glm::dot(ac, bp);
  if (d3 >= 0 && d4 <= d3) return b;
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return a + d1 / (d1 - d3) * ab;
  const double d5 = glm::dot(ab, cp), d6 = glm::dot(ac, cp);
  if (d6 >= 0 && d5 <= d6) return c;
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return a + d2 / (d2 - d6) * ac;
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 >= d3 && d5 >= d6) return b + (d4 - d3) / (d4 - d3 + d5 - d6) * (c - b);
  return a + vb / (va + vb + vc) * ab + vc / (va + vb + vc) * ac;
}

}  // namespace

// Visits nodes that enter(node) lets through, depth first, and triangles of leaves.
template <class Enter, class Visit>
void Solid::walk(Enter&& enter, Visit&& visit) const {
  std::uint32_t stack[128], top = 0;
  if (!nodes.empty()) stack[top++] = 0;
  while (top > 0) {
    const std::uint32_t i = stack[--top];
    const Node& node = nodes[i];
    if (!enter(node)) continue;
    if (node.right > 0)
      stack[top++] = node.right, stack[top++] = i + 1;
    else
      for (std::uint32_t k = node.first; k < node.first + node.count; ++k) visit(order[k]);
  }
}

Solid::Solid(const SurfaceMesh& given) : surface(given), order(given.triangles.size()) {
  std::iota(order.begin(), order.end(), 0u);
  std::vector<glm::dvec3> middles;
  for (const auto& [a, b, c] : surface.triangles)
    middles.push_back((surface.positions[a] + surface.positions[b] + surface.positions[c]) / 3.0);
  if (!order.empty()) build(0, std::uint32_t(order.size()), middles);
}

void Solid::build(std::uint32_t first, std::uint32_t count, const std::vector<glm::dvec3>& middles) {
  constexpr std::uint32_t leaf = 6;
  const std::size_t number = nodes.size();
  Node node{glm::dvec3(INFINITY), glm::dvec3(-INFINITY), glm::dvec3(0), glm::dvec3(0), 0, first, count, 0};
  glm::dvec3 low(INFINITY), high(-INFINITY);
  double area = 0;
  for (std::uint32_t k = first; k < first + count; ++k) {
    const Triangle& t = surface.triangles[order[k]];
    const glm::dvec3 &a = surface.positions[t[0]], &b = surface.positions[t[1]], &c = surface.positions[t[2]];
    const glm::dvec3 normal = 0.5 * glm::cross(b - a, c - a), middle = middles[order[k]];
    node.normal += normal;
    node.centre += glm::length(normal) * middle, area += glm::length(normal);
    node.low = glm::min(glm::min(node.low, a), glm::min(b, c));
    node.high = glm::max(glm::max(node.high, a), glm::max(b, c));
    low = glm::min(low, middle), high = glm::max(high, middle);
  }
  node.centre = area > 0 ? node.centre / area : 0.5 * (node.low + node.high);
  node.radius = glm::length(glm::max(node.high - node.centre, node.centre - node.low));
  nodes.push_back(node);
  if (count <= leaf) return;
  const glm::dvec3 extent = high - low;
  const int axis = extent.x >= extent.y && extent.x >= extent.z ? 0 : extent.y >= extent.z ? 1 : 2;
  const auto begin = order.begin() + first;
  std::nth_element(begin, begin + count / 2, begin + count, [&](std::uint32_t a, std::uint32_t b) {
    return std::pair(middles[a][axis], a) < std::pair(middles[b][axis], b);
  });
  build(first, count / 2, middles);
  nodes[number].right = std::uint32_t(nodes.size());
  build(first + count / 2, count - count / 2, middles);
}

double Solid::winding(const glm::dvec3& p) const {
  constexpr double far = 2.3;  // radii, from where a node is a dipole
  double angle = 0;
  walk(
      [&](const Node& node) {
        const glm::dvec3 d = node.centre - p;
        const double r = glm::length(d);
        if (r <= far * node.radius) return true;
        angle += glm::dot(node.normal, d) / (r * r * r);
        return false;
      },
      [&](std::uint32_t triangle) {  // its solid angle (Van Oosterom and Strackee 1983)
        const Triangle& t = surface.triangles[triangle];
        const glm::dvec3 a = surface.positions[t[0]] - p, b = surface.positions[t[1]] - p,
                         c = surface.positions[t[2]] - p;
        const double u = glm::length(a), v = glm::length(b), w = glm::length(c);
        angle += 2 * std::atan2(glm::dot(a, glm::cross(b, c)),
                                u * v * w + glm::dot(a, b) * w + glm::dot(b, c) * u + glm::dot(c, a) * v);
      });
  return angle / (4 * std::numbers::pi);
}

Solid::Nearest Solid::nearest(const glm::dvec3& p, double limit) const {
  Nearest best{limit, p, 0};
  double squared = limit * limit;
  const auto apart = [&](const Node& node) {
    const glm::dvec3 d = glm::max(glm::max(node.low - p, p - node.high), glm::dvec3(0));
    return glm::dot(d, d);
  };
  std::pair<std::uint32_t, double> stack[128];
  int top = 0;
  if (!nodes.empty()) stack[top++] = {0, apart(nodes[0])};
  while (top > 0) {
    const auto [i, away] = stack[--top];
    const Node& node = nodes[i];
    if (away >= squared) continue;
    if (node.right > 0) {  // the nearer child first
      std::pair<std::uint32_t, double> left{i + 1, apart(nodes[i + 1])}, right{node.right, apart(nodes[node.right])};
      if (left.second < right.second) std::swap(left, right);
      stack[top++] = left, stack[top++] = right;
      continue;
    }
    for (std::uint32_t k = node.first; k < node.first + node.count; ++k) {
      const Triangle& t = surface.triangles[order[k]];
      const glm::dvec3 q =
          nearest_in_triangle(p, surface.positions[t[0]], surface.positions[t[1]], surface.positions[t[2]]);
      const double d = glm::dot(q - p, q - p);
      if (d < squared) squared = d, best = {std::sqrt(d), q, order[k]};
    }
  }
  return best;
}

void Solid::find_crossings(const glm::dvec3& a, const glm::dvec3& b, std::vector<Crossing>& found) const {
  found.clear();
  const glm::dvec3 d = b - a, low = glm::min(a, b), high = glm::max(a, b), inverse = 1.0 / d;
  walk(
      [&](const Node& node) {
        if (glm::any(glm::lessThan(high, node.low)) || glm::any(glm::lessThan(node.high, low))) return false;
        double from = 0, to = 1;
        for (int k = 0; k < 3; ++k) {
          if (d[k] == 0) continue;
          const double s = (node.low[k] - a[k]) * inverse[k], t = (node.high[k] - a[k]) * inverse[k];
          from = std::max(from, std::min(s, t)), to = std::min(to, std::max(s, t));
        }
        return from <= to + 1e-12;
      },
      [&](std::uint32_t triangle) {  // Moeller and Trumbore 1997
        const Triangle& t = surface.triangles[triangle];
        const glm::dvec3 &x = surface.positions[t[0]], u = surface.positions[t[1]] - x, v = surface.positions[t[2]] - x;
        const glm::dvec3 across = glm::cross(d, v);
        const double det = glm::dot(u, across);
        if (det == 0) return;
        const glm::dvec3 s = a - x, q = glm::cross(s, u);
        const double i = glm::dot(s, across) / det, j = glm::dot(d, q) / det, at = glm::dot(v, q) / det;
        if (i < 0 || j < 0 || i + j > 1 || at < 0 || at > 1) return;
        found.push_back({at, det > 0 ? 1.0 : -1.0});  // det > 0: against the normal, inward
      });
  std::ranges::sort(found, {}, &Crossing::at);
}

double Solid::winding_at(const glm::dvec3& b, const glm::dvec3& a, double at_a) const {
  thread_local std::vector<Crossing> found;
  find_crossings(a, b, found);
  for (const Crossing& crossing : found) at_a += crossing.jump;
  return at_a;
}

bool Solid::sees(const glm::dvec3& a, double at_a, const glm::dvec3& b) const {
  thread_local std::vector<Crossing> found;
  find_crossings(a, b, found);
  for (std::size_t k = 0; k < found.size(); ++k) {
    at_a += found[k].jump;
    const double end = k + 1 < found.size() ? found[k + 1].at : 1;
    if (at_a <= inside_winding && end - found[k].at > 1e-9) return false;
  }
  return true;
}

}  // namespace tetpbd
