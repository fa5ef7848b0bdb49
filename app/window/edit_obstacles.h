// Obstacles changed in the window: the lanes go on from where they are.
#pragma once

#include <optional>

#include "app/window/session.h"

namespace tetpbd {

void change_obstacles(Session& session, std::vector<Obstacle> wanted);
void choose_obstacle(Session& session, int number);
/// One more, at the right of the bodies as they are seen, and chosen; a mesh from the path in the panel.
void add_obstacle(Session& session, const ObstacleKind& kind);
void remove_obstacle(Session& session);

void move_by(Obstacle& obstacle, const glm::dvec3& way);
void turn_by(Obstacle& obstacle, const glm::dmat3& turn);  ///< about its centre

/// Of the arrows at the chosen obstacle, along the world's axes: m, as long in every picture.
double gizmo_length(const Session& session);
/// The axis of the arrow that is seen there, in a lane's place.
std::optional<int> gizmo_at(const Session& session, const Rect& place, glm::vec2 cursor);
/// Along that arrow, m, for so much on the screen.
double along_gizmo(const Session& session, const Rect& place, int axis, glm::vec2 moved);
/// Whether the camera could see it.
bool in_front(const Session& session, const glm::dvec3& point);

struct ObstacleHit {
  int number = -1;
  double distance = 0;  ///< m, along the ray
};
/// The first that a ray meets from outside.
std::optional<ObstacleHit> obstacle_on(const Session& session, const Ray& ray);

}  // namespace tetpbd
