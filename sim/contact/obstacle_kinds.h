// Kinds of obstacles: one row each. Scenes, the window, every mode's contact, error measures and pictures follow from
// the row and from its signed distance, NAME_surface() in shaders/contact/obstacles/NAME.glsl.
#pragma once

#include <string>
#include <vector>

#include "sim/contact/obstacle.h"
#include "sim/model/formulas.h"

namespace tetpbd {

/// A corner of a triangle for pictures, in an obstacle's own coordinates: m, unit length.
struct ObstacleCorner {
  glm::vec3 position, normal;
};

struct ObstacleKind {
  const char* name;  ///< in scenes; with '_' for '-' the name of the file
  Formulas<double>::Distance distance;
  std::vector<std::string> needs;  ///< keys that a scene must give, beside those of all kinds
  std::vector<std::string> reads;  ///< keys that it may give
  /// m: the half extents of a box around the centre that holds the surface; nullptr: the surface is infinite.
  glm::dvec3 (*half)(const Obstacle&) = nullptr;
  /// m: a bound on the distance of the surface from the centre; nullptr: the length of `half`, or infinite.
  double (*reach)(const Obstacle&) = nullptr;
  bool convex = true;  ///< lies behind the plane that its distance and normal at any point outside give
  bool flat = false;   ///< is the half space behind that plane
  bool edged = false;  ///< may have sharp edges
  /// Its triangles for pictures; nullptr: found from the distance.
  std::vector<ObstacleCorner> (*picture)(const Obstacle&) = nullptr;

  /// Whether a scene may give it this key.
  bool has(const std::string& key) const;
  int number() const;            ///< of its row
  std::string function() const;  ///< NAME_surface
};
const std::vector<ObstacleKind>& obstacle_kinds();
/// nullptr if there is none.
const ObstacleKind* find_obstacle_kind(const std::string& name);

/// m: a bound on the distance of its surface from its centre, which may be infinite.
double bound_reach(const Obstacle& obstacle);
/// What its signed distance reads, except the first value of its field among those of all obstacles.
Formulas<double>::Solid describe_solid(const Obstacle& obstacle);
/// Triangles of its surface for pictures, three corners each; none for a half space.
std::vector<ObstacleCorner> tessellate(const Obstacle& obstacle);

}  // namespace tetpbd
