#include "sim/reference/total_error.h"

#include <fmt/format.h>

#include <algorithm>

#include "sim/error.h"

namespace tetpbd {

TotalError total_error(std::shared_ptr<const Truth> truth, const Model& model) {
  const Model& finer = *truth->model;
  if (finer.bodies.size() != model.bodies.size())
    throw Error("the motion on finer meshes is of other bodies",
                fmt::format("{} of them, not {}", finer.bodies.size(), model.bodies.size()), "name the same scene");
  const auto belongs = [&](std::size_t vertex, std::uint32_t tet) {
    const auto body = std::size_t(&body_at(finer, vertex) - finer.bodies.data());
    const Body& own = model.bodies[body];
    return tet >= own.first_tet && tet < own.first_tet + own.tets;
  };
  CarriedSurface points = carry({finer.rest.positions, {}}, model.rest, "the mesh of " + model.bodies[0].name, belongs);
  Points offset = carried_positions(points, model.rest.tets, model.rest.positions);
  for (std::size_t i = 0; i < offset.size(); ++i) offset[i] = finer.rest.positions[i] - offset[i];
  return {std::move(truth), std::move(points), std::move(offset)};
}

void add_state(MotionError& error, const TotalError& total, const Model& model, long step, const State& state) {
  State there{carried_positions(total.points, model.rest.tets, state.positions), {}};
  for (std::size_t i = 0; i < there.positions.size(); ++i) there.positions[i] += total.offset[i];
  add_state(error, total.truth->motion, *total.truth->model, step, there);
}

}  // namespace tetpbd
