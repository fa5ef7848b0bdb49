// The total error of a run, that of its mesh, its steps and its solver together: its distance from the motion of the
// same bodies on finer meshes of ten-node tets (ten_node.h). Both are compared at the vertices of the finer mesh.
#pragma once

#include <memory>

#include "sim/mesh/carry.h"
#include "sim/reference/motion.h"

namespace tetpbd {

struct Truth {
  std::shared_ptr<const Model> model;  ///< the finer one, whose vertices are the corners of the ten-node tets
  Motion motion;
};
/// Where the truth's vertices are in the tets of another model of the same bodies.
struct TotalError {
  std::shared_ptr<const Truth> truth;
  CarriedSurface points;
  Points offset;  ///< m, from where those tets carry them at rest to where they are
};
/// Throws Error where the bodies are not the same.
TotalError total_error(std::shared_ptr<const Truth> truth, const Model& model);
/// As add_state() of motion.h. It compares displacements from rest, as meshes of one body differ there already.
void add_state(MotionError& error, const TotalError& total, const Model& model, long step, const State& state);

}  // namespace tetpbd
