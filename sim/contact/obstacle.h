// An obstacle as a scene describes it: a half space or another shape with a signed distance (obstacle_kinds.h), at rest
// or moving. Bodies do not move it.
#pragma once

#include <filesystem>
#include <glm/glm.hpp>
#include <memory>
#include <optional>
#include <vector>

#include "sim/contact/path.h"
#include "sim/mesh/distance_field.h"

namespace tetpbd {

struct ObstacleKind;
/// The first row of the table: a half space.
const ObstacleKind* default_obstacle_kind();

/// Members that its kind does not name have no effect.
struct Obstacle : Path {  // whose centre is a point of the surface of a half space
  const ObstacleKind* kind = default_obstacle_kind();
  glm::dvec3 normal{0};                ///< of a half space, of any length but 0
  double radius = 0, half_length = 0;  ///< m
  glm::dvec3 half{0};                  ///< m, half lengths along its own axes
  std::filesystem::path image, mesh;
  std::vector<std::vector<double>> heights;     ///< rows along x, in order of z, from 0 (bottom) to 1 (top)
  glm::dvec3 scale{1};                          ///< of a mesh, as of a body's
  double height = 0;                            ///< m, of a mesh
  int voxels = 64;                              ///< along the longest side of a mesh
  std::optional<double> friction, restitution;  ///< none: the world's

  /// Of a mesh, signed distances in its own coordinates; of a height field, heights in m (size.y is 1).
  std::shared_ptr<const DistanceField> field;
  std::shared_ptr<const SurfaceMesh> surface;  ///< of a mesh, in its own coordinates, for pictures
  double trust = 1;  ///< true distances are at least this times the computed ones, which for heights may be too long
};
/// Makes the field of a height field from rows like `heights`.
void set_heights(Obstacle& obstacle, const std::vector<std::vector<double>>& rows);

/// All that its motion and contact with it depend on, except the values of its field.
std::vector<double> obstacle_values(const Obstacle& obstacle);

Pose pose_at(const Obstacle& obstacle, double time);

}  // namespace tetpbd
