// The obstacles of a simulation on the GPU: planes in the step's block, records of all others for each substep, and the
// values of their distance fields and height fields. Kernels: shaders/contact/obstacles.glsl.
#pragma once

#include <string>
#include <vector>

#include "sim/gl/gpu.h"
#include "sim/gl/layout.h"
#include "sim/model/model.h"

namespace tetpbd {

struct Sim;

struct Obstacles {
  static constexpr int most_lists = 256;  ///< in `records` at once
  /// Lists at the start of a step and at the end of each substep, or a single list where nothing moves: for each
  /// obstacle its centre and how far from there contact is possible, then for each its ObstacleRecord.
  Buffer records;
  Buffer fields;  ///< of all obstacles, one after the other
  Texture fields_texture;
  Buffer surfaces;  ///< by vertex friction and restitution, if any body has its own
  Texture surfaces_texture;
  std::size_t bytes = 0, stride = 0;  ///< of a list; from one list to the next
  int first = 0, present = 0;         ///< number in the step of the first list in `records`, and of the bound one
};

/// Definitions that contact/obstacles.glsl needs for this model's obstacles; `own_surfaces`: has_own_surfaces(), where
/// kernels ask for friction or restitution.
std::vector<std::string> obstacle_defines(const Model& model, bool own_surfaces);
/// Whether kernels and fields made for one model can be used for the other.
bool share_kernels(const Model& model, const Model& other);
/// Throws Error if there are too many obstacles, or their fields are too large.
Obstacles make_obstacles(const Model& model, const Settings& settings);

/// Writes what the surfaces of bodies are like now.
void write_surfaces(Sim& sim);
/// Writes the obstacles that are planes.
void write_planes(const Model& model, const Settings& settings, Step& block);
/// Writes lists of all other obstacles, from number `first` of the step on, which becomes the present one.
void write_obstacles(Sim& sim, int first = 0);
/// Binds the present list for the next kernels.
void bind_obstacles(const Obstacles& obstacles);
/// Binds the list of the next substep.
void bind_next_obstacles(Sim& sim);

}  // namespace tetpbd
