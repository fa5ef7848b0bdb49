// What bodies touch and never move, as a scene describes it: half spaces, and all that has a signed distance
// (obstacle_kinds.h), at rest or moving.
#pragma once

#include <filesystem>
#include <glm/glm.hpp>
#include <memory>
#include <optional>
#include <vector>

#include "sim/mesh/distance_field.h"

namespace tetpbd {

struct ObstacleKind;
/// The first row of the table: a half space.
const ObstacleKind* default_obstacle_kind();

/// What its kind does not ask for plays no part.
struct Obstacle {
  struct Key {
    double time = 0;                    ///< s
    glm::dvec3 centre{0}, rotation{0};  ///< m, degrees
  };
  const ObstacleKind* kind = default_obstacle_kind();
  glm::dvec3 centre{0};    ///< m; of a half space, a point of its surface
  glm::dvec3 normal{0};    ///< of a half space, of any length but 0
  glm::dvec3 rotation{0};  ///< degrees about x, then y, then z
  double radius = 0, half_length = 0;
  glm::dvec3 half{0};  ///< m, half lengths along its own axes
  std::filesystem::path image, mesh;
  std::vector<std::vector<double>> heights;  ///< rows along x, one behind the other along z; 0: bottom, 1: top
  glm::dvec3 scale{1};                       ///< of a mesh, as of a body's
  double height = 0;
  int voxels = 64;                              ///< along the longest side of a mesh
  std::optional<double> friction, restitution;  ///< none: the world's
  glm::dvec3 velocity{0}, spin{0};              ///< m/s; rad/s about the centre
  std::vector<Key> keyframes;  ///< by time, linear in between and from the start, at rest after the last

  /// In its own coordinates, of a height field (metres, size.y is 1) and of a mesh.
  std::shared_ptr<const DistanceField> field;
  std::shared_ptr<const SurfaceMesh> surface;  ///< of a mesh, in its own coordinates, for pictures
  double trust = 1;  ///< of a height field: what a distance along its normal is worth where it is steepest
};
/// The field of a height field, from rows as `heights`.
void set_heights(Obstacle& obstacle, const std::vector<std::vector<double>>& rows);

bool moves(const Obstacle& obstacle);

/// All that its motion and contact with it depend on, beside the values of its field.
std::vector<double> obstacle_values(const Obstacle& obstacle);

struct Pose {
  glm::dvec3 centre{0};
  glm::dmat3 axes{1};  ///< columns: where its own axes point
};
/// Of angles about x, then y, then z, degrees.
glm::dmat3 rotation_of(const glm::dvec3& degrees);
Pose pose_at(const Obstacle& obstacle, double time);

}  // namespace tetpbd
