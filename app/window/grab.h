// Vertices held by the mouse: pinned, and led towards the cursor no faster than the body can follow.
#pragma once

#include <vector>

#include "app/window/lanes.h"
#include "render/camera.h"
#include "render/picking.h"
#include "sim/sim.h"

namespace tetpbd {

/// A vertex, and those around it, so that pulling draws out no spike. They fall behind it, the farther the
/// more, by up to `slack`.
struct Hold {
  std::vector<std::uint32_t> vertices;  ///< the caught one first
  std::vector<glm::dvec3> starts;       ///< m, when caught
  std::vector<double> behind;           ///< part of the slack: 0 of the caught one, 1 at the rim
  double slack = 0;                     ///< m
  bool was_pinned = false;              ///< the caught one, by the user: it stays so when let go, and is alone
  std::uint32_t caught() const { return vertices.front(); }
  bool has(std::uint32_t vertex) const;
};
/// `radius`: a part of the size; 0: the vertex alone. Pins nothing. Waits for the GPU, to know where they
/// are.
Hold take_hold(const Sim& sim, std::uint32_t vertex, double radius);
void pin_held(Sim& sim, const Hold& hold);
void unpin_held(Sim& sim, const Hold& hold);
/// The caught vertex to this place, m; the others after it, but into no ground or wall.
void move_held(Sim& sim, const Hold& hold, const glm::dvec3& to);

/// How the mouse leads what it holds.
struct Grab {
  glm::dvec3 hit{0};                   ///< m, where the ray met the surface: the drag keeps this depth
  glm::dvec3 start{0}, position{0};    ///< m, of the caught vertex: when caught, and now
  glm::dvec3 target{0};                ///< m, where the cursor wants it
  double edge = 0;                     ///< m, mean rest length of the vertex's edges
  double slack = 0;                    ///< m, the hold's
  glm::dvec3 resting{0};               ///< m, from its neighbours' mean to the vertex when caught
  glm::dvec3 seen{0}, neighbours{0};   ///< m, vertex and mean of its neighbours a frame or so ago
  std::vector<std::uint32_t> watched;  ///< some neighbours of what is held, then the vertex
  Buffer copy;                         ///< of their positions, on its way back
  Fence copied;
};

/// Waits for the GPU.
Grab begin_grab(const Sim& sim, const Hold& hold, const Pick& pick);
/// Takes in what has been read back, and aims at the point under the cursor at the depth of the hit.
void aim(Grab& grab, const Lane& lane, const Camera& camera, const Ray& cursor);
/// Before each step: where it goes next.
void lead(Grab& grab);

}  // namespace tetpbd
