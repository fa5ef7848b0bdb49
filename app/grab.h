// A vertex held by the mouse: pinned, and led towards the cursor no faster than the body can follow.
#pragma once

#include <span>
#include <vector>

#include "render/camera.h"
#include "render/picking.h"
#include "sim/sim.h"

namespace tetpbd {

struct Grab {
  std::uint32_t vertex = 0;
  bool was_pinned = false;             ///< by the user: it stays so when let go
  glm::dvec3 hit{0};                   ///< m, where the ray met the surface: the drag keeps this depth
  glm::dvec3 start{0}, position{0};    ///< m, of the vertex: when caught, and now
  glm::dvec3 target{0};                ///< m, where the cursor wants it
  double edge = 0;                     ///< m, mean rest length of the vertex's edges
  double resting = 0;                  ///< m, distance of the vertex from its neighbours' mean when caught
  glm::dvec3 seen{0}, neighbours{0};   ///< m, vertex and mean of its neighbours a frame or so ago
  std::vector<std::uint32_t> watched;  ///< the neighbours, then the vertex
  Buffer copy;                         ///< of their positions, on its way back
  Fence copied;
};

/// Pins the vertex that was picked. Waits for the GPU, to know where it is.
Grab begin_grab(Sim& sim, const Pick& pick);
/// Takes in what has been read back, and aims at the point under the cursor at the depth of the hit.
void aim(Grab& grab, const Sim& sim, const Camera& camera, const Ray& cursor,
         std::span<const glm::dvec4> planes);
/// Before each step: leads the vertex on.
void lead(Grab& grab, Sim& sim);

}  // namespace tetpbd
