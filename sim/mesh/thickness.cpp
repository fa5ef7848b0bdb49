#include "sim/mesh/thickness.h"

#include <algorithm>

#include "sim/parallel.h"

namespace tetpbd {

double area_of(const SurfaceMesh& surface) {
  double area = 0;
  for (const auto& [a, b, c] : surface.triangles) {
    const auto& x = surface.positions;
    area += glm::length(glm::cross(x[b] - x[a], x[c] - x[a])) / 2;
  }
  return area;
}

std::vector<Depth> measure_depths(const SurfaceMesh& surface, const Solid& solid) {
  constexpr std::size_t rays = 2000;
  const double size = bounds(surface.positions).size(), step = area_of(surface) / rays;
  std::vector<std::uint32_t> from;  // triangles, as often as their area says
  double sum = step / 2;
  for (std::uint32_t i = 0; i < surface.triangles.size(); ++i) {
    const auto& [a, b, c] = surface.triangles[i];
    const auto& x = surface.positions;
    for (sum += glm::length(glm::cross(x[b] - x[a], x[c] - x[a])) / 2; sum >= step && from.size() < rays; sum -= step)
      from.push_back(i);
  }
  std::vector<Depth> depths(from.size());
  parallel_for(depths.size(), 64, [&](std::size_t k) {
    const auto& [a, b, c] = surface.triangles[from[k]];
    const auto& x = surface.positions;
    const glm::dvec3 normal = glm::cross(x[b] - x[a], x[c] - x[a]), middle = (x[a] + x[b] + x[c]) / 3.0;
    const glm::dvec3 n = normal / glm::length(normal), start = middle - 1e-6 * size * n;
    depths[k] = {INFINITY, middle};
    double winding = solid.winding(start);
    if (!(winding > inside_winding)) return;
    std::vector<Solid::Crossing> found;
    solid.find_crossings(start, start - size * n, found);
    for (const auto& [at, jump] : found)
      if (winding += jump; !(winding > inside_winding)) {
        depths[k].depth = (at + 1e-6) * size;
        return;
      }
  });
  std::ranges::sort(depths, {}, &Depth::depth);
  return depths;
}

Depth thinnest(const std::vector<Depth>& depths) {
  const Depth none{NAN, glm::dvec3(NAN)};
  return depths.empty() || !std::isfinite(depths[depths.size() / 50].depth) ? none : depths[depths.size() / 50];
}

Depth thinnest_part(const SurfaceMesh& surface) {
  return surface.triangles.size() > 300'000 ? thinnest({}) : thinnest(measure_depths(surface, Solid(surface)));
}

}  // namespace tetpbd
