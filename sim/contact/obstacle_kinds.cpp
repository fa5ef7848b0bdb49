#include "sim/contact/obstacle_kinds.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "sim/contact/obstacle_pictures.h"

namespace tetpbd {

namespace {

using Rules = Formulas<double>;

glm::dvec3 mesh_half(const Obstacle& o) {
  if (!o.surface) return glm::dvec3(0.5 * o.height);
  const Bounds box = bounds(o.surface->positions);
  return 0.5 * (box.high - box.low);
}

double field_reach(const Obstacle& o) {
  if (!o.field) return 0;
  const glm::dvec3 end = o.field->origin + o.field->spacing * glm::dvec3(o.field->size - 1);
  return glm::length(glm::max(glm::abs(o.field->origin), glm::abs(end)));
}

// m, of edges in pictures.
float rounding_radius(const glm::dvec3& half) { return 0.04f * float(std::min({half.x, half.y, half.z})); }

}  // namespace

const std::vector<ObstacleKind>& obstacle_kinds() {
  static const std::vector<ObstacleKind> rows = {
      {.name = "half-space",
       .distance = &Rules::half_space_surface,
       .needs = {"normal"},
       .reads = {"point"},
       .flat = true},
      {.name = "sphere",
       .distance = &Rules::sphere_surface,
       .needs = {"radius"},
       .reads = {"centre"},
       .half = [](const Obstacle& o) { return glm::dvec3(o.radius); },
       .reach = [](const Obstacle& o) { return o.radius; },
       .picture = [](const Obstacle& o) { return rounded(glm::vec3(0), 0, float(o.radius)); }},
      {.name = "capsule",
       .distance = &Rules::capsule_surface,
       .needs = {"radius", "half_length"},
       .reads = {"centre", "rotation"},
       .half = [](const Obstacle& o) { return glm::dvec3(o.radius, o.half_length + o.radius, o.radius); },
       .reach = [](const Obstacle& o) { return o.half_length + o.radius; },
       .picture = [](const Obstacle& o) { return rounded(glm::vec3(0, o.half_length, 0), 0, float(o.radius)); }},
      {.name = "box",
       .distance = &Rules::box_surface,
       .needs = {"half"},
       .reads = {"centre", "rotation"},
       .half = [](const Obstacle& o) { return o.half; },
       .edged = true,
       .picture =
           [](const Obstacle& o) {
             const float round = rounding_radius(o.half);
             return rounded(glm::vec3(o.half) - round, 0, round);
           }},
      {.name = "cylinder",
       .distance = &Rules::cylinder_surface,
       .needs = {"radius", "half_length"},
       .reads = {"centre", "rotation"},
       .half = [](const Obstacle& o) { return glm::dvec3(o.radius, o.half_length, o.radius); },
       .reach = [](const Obstacle& o) { return glm::length(glm::dvec2(o.half_length, o.radius)); },
       .edged = true,
       .picture =
           [](const Obstacle& o) {
             const float round = rounding_radius({o.radius, o.half_length, o.radius});
             return rounded({0, float(o.half_length) - round, 0}, float(o.radius) - round, round);
           }},
      {.name = "height-field",
       .distance = &Rules::height_field_surface,
       .needs = {"half"},
       .reads = {"centre", "rotation", "image", "heights"},
       .half = [](const Obstacle& o) { return o.half; },
       .reach = [](const Obstacle&) { return std::numeric_limits<double>::infinity(); },  // it has no bottom
       .convex = false,
       .edged = true,
       .picture = height_triangles},
      {.name = "mesh",
       .distance = &Rules::mesh_surface,
       .needs = {"mesh"},
       .reads = {"centre", "rotation", "scale", "height", "voxels"},
       .half = mesh_half,
       .reach = field_reach,
       .convex = false,
       .edged = true,
       .picture = mesh_triangles},
      // The next row goes here.
  };
  return rows;
}
const ObstacleKind* default_obstacle_kind() { return obstacle_kinds().data(); }
const ObstacleKind* find_obstacle_kind(const std::string& name) {
  const auto& rows = obstacle_kinds();
  const auto found = std::ranges::find(rows, name, &ObstacleKind::name);
  return found == rows.end() ? nullptr : &*found;
}

bool ObstacleKind::has(const std::string& key) const {
  return std::ranges::count(needs, key) + std::ranges::count(reads, key) > 0;
}
int ObstacleKind::number() const { return int(this - default_obstacle_kind()); }
std::string ObstacleKind::function() const {
  std::string word = name;
  std::ranges::replace(word, '-', '_');
  return word + "_surface";
}

double bound_reach(const Obstacle& o) {
  if (o.kind->reach) return o.kind->reach(o);
  return o.kind->half ? glm::length(o.kind->half(o)) : std::numeric_limits<double>::infinity();
}

Formulas<double>::Solid describe_solid(const Obstacle& o) {
  Formulas<double>::Solid s{};
  s.kind = o.kind->number(), s.convex = o.kind->convex, s.trust = o.trust, s.radius = o.radius;
  if (o.kind->has("half_length")) s.extent.y = o.half_length;
  if (o.kind->has("half")) s.extent = o.half;
  if (o.field) s.spacing = o.field->spacing, s.origin = o.field->origin, s.cells = o.field->size;
  return s;
}

}  // namespace tetpbd
