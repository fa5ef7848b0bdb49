// The obstacles of a simulation on the GPU: planes in the step's block, records of all others for each
// substep, and the values of their fields. Kernels: shaders/contact/obstacles.glsl.
#pragma once

#include <string>
#include <vector>

#include "sim/gl/gpu.h"
#include "sim/gl/layout.h"
#include "sim/model/model.h"

namespace tetpbd {

struct Sim;

struct Obstacles {
  static constexpr int most_lists = 256;  ///< written at once
  Buffer records;  ///< ObstacleRecord, and before them how far each is met: a list of the step's start, then
                   ///< one of the end of each substep; a single list where nothing moves
  Buffer fields;   ///< one after the other
  Texture fields_texture;
  Buffer friction;  ///< by vertex, where bodies have their own; negative: the world's
  Texture friction_texture;
  std::size_t bytes = 0, stride = 0;  ///< of a list; from one to the next
  int first = 0, present = 0;         ///< which lists `records` begins with, and is of now
};

/// Definitions for kernels that include contact/obstacles.glsl: what these are made for.
std::vector<std::string> obstacle_defines(const Model& model);
/// Whether kernels and fields that are made for one model serve the other, which has other obstacles.
bool share_kernels(const Model& model, const Model& other);
/// Throws Error where there are too many, or their fields are too large.
Obstacles make_obstacles(const Model& model);

/// Those that are planes.
void write_planes(const Model& model, const Settings& settings, Step& block);
/// All others: lists of the step from this one on, which becomes the present.
void write_obstacles(Sim& sim, int first = 0);
/// The present list, for the next kernels.
void bind_obstacles(const Obstacles& obstacles);
/// The same of the next substep.
void bind_next_obstacles(Sim& sim);

}  // namespace tetpbd
