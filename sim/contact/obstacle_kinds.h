// Kinds of obstacles: one row each. Scenes, the window, every mode's contact, error measures and pictures
// follow from the row and from the signed distance in shaders/contact/obstacles/, NAME.glsl with
// NAME_surface().
#pragma once

#include <string>
#include <vector>

#include "sim/contact/obstacle.h"
#include "sim/model/formulas.h"

namespace tetpbd {

/// A corner of a triangle of a picture, m and unit length, in an obstacle's own coordinates.
struct ObstacleCorner {
  glm::vec3 position, normal;
};

struct ObstacleKind {
  const char* name;  ///< in scenes; with '_' for '-' the name of the file
  Formulas<double>::Distance distance;
  std::vector<std::string> needs,
      reads;  ///< keys of a scene that must and may be there, beside what all have
  /// m: the half extents of a box around the centre that holds the surface; none: it has no end.
  glm::dvec3 (*half)(const Obstacle&) = nullptr;
  /// m: all of the surface is nearer to the centre; none: the length of `half`, or no end.
  double (*reach)(const Obstacle&) = nullptr;
  bool convex = true;  ///< lies behind the plane at the point that its distance takes for the nearest
  bool flat = false;   ///< is the half space behind that plane
  /// Its triangles for pictures; none: found from the distance.
  std::vector<ObstacleCorner> (*picture)(const Obstacle&) = nullptr;

  /// Whether a scene may give it this key.
  bool has(const std::string& key) const;
  int number() const;  ///< of its row
  /// NAME_surface.
  std::string function() const;
};
const std::vector<ObstacleKind>& obstacle_kinds();
/// nullptr if there is none.
const ObstacleKind* find_obstacle_kind(const std::string& name);

/// m: all of its surface is nearer to its centre; infinite where it has no end.
double bound_reach(const Obstacle& obstacle);
/// As distances read it, but for where its field begins among others.
Formulas<double>::Solid describe_solid(const Obstacle& obstacle);
/// Triangles of its surface for pictures, three corners each; none of a half space.
std::vector<ObstacleCorner> tessellate(const Obstacle& obstacle);

}  // namespace tetpbd
