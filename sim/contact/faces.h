// Faces of bodies against obstacles that could get in between their vertices (method.md, "Obstacles with a shape"): a
// cloth over the edge of a box, a block of few tets on a post.
#pragma once

#include "sim/contact/moving_obstacle.h"
#include "sim/gl/pass.h"

namespace tetpbd {

struct Sim;
struct SolverInput;

/// Those that have to be looked at: of sheets where an obstacle has edges, and of all bodies whose edges are longer
/// than half of an obstacle's smallest half extent.
std::vector<Triangle> wide_faces(const Model& model);

/// Moves vertices at `x` of velocities `v` after a substep of `h` on the CPU; adds to `work`, if it is not empty.
void move_faces_out(const Model& model, const Settings& settings, const std::vector<Triangle>& faces,
                    const std::vector<MovingObstacle>& obstacles, double h, std::vector<glm::dvec3>& x,
                    std::vector<glm::dvec3>& v, const std::vector<double>& inverse_masses, std::vector<double>& work);
/// m, how deep any of them is in an obstacle; 0: none is.
double deepest_face(const std::vector<Triangle>& faces, const std::vector<MovingObstacle>& obstacles,
                    const std::vector<glm::dvec3>& x);

/// The same on the GPU, a part of a Sim.
struct Faces {
  Buffer corners, sums;
  Pass pass;
  explicit operator bool() const { return bool(corners); }
};
Faces make_faces(const SolverInput& input);
/// After the solver's last dispatch of a substep.
void move_faces_out(Sim& sim);

}  // namespace tetpbd
