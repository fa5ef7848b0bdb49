// Makes the frame of a picture from the present state of a simulation.
#include "render/frame.h"

#include <iterator>
#include <ranges>

#include "sim/contact/moving_obstacle.h"
#include "sim/model/material.h"

namespace tetpbd {

// Vertices that touch obstacles other than half spaces, for which the GPU finds them itself. As in metrics, they are
// nearer than 10^-5 of the size. Waits for the GPU.
static std::vector<std::uint32_t> find_touching(const Sim& sim) {
  auto obstacles = obstacles_at(*sim.model, sim.settings, simulated_time(sim));
  std::erase_if(obstacles, [](const MovingObstacle& o) { return o.kind->flat; });
  if (obstacles.empty()) return {};
  const double near = 1e-5 * sim.model->size;
  std::vector<std::uint32_t> touching;
  const State state = read_state(sim);
  for (std::uint32_t v = 0; v < state.positions.size(); ++v) {
    const glm::dvec3& x = state.positions[v];
    if (std::ranges::any_of(obstacles, [&](const MovingObstacle& o) {
          return glm::distance(x, o.pose.centre) < 1.01 * o.reach + near && o.surface_at(x).distance < near;
        }))
      touching.push_back(v);
  }
  return touching;
}

void update(Frame& frame, const Sim& sim) {
  frame.time = simulated_time(sim);
  frame.pairs = sim.pairs && sim.pairs.near ? &sim.pairs : nullptr;
  if (frame.options.contacts) frame.touching = find_touching(sim);
}

Frame make_frame(const Sim& sim, const Camera& camera, const ViewOptions& options, const Target& target) {
  Frame frame;
  frame.positions = sim.positions.id();
  frame.velocities = sim.velocities.id();
  frame.camera = camera;
  frame.viewport = {0, 0, target.width, target.height};
  frame.options = options;
  if (sim.settings.ground) frame.ground = float(sim.settings.ground_height);
  frame.materials.clear();
  for (const Body& body : sim.model->bodies) {
    glm::vec4& material = frame.materials.emplace_back(energy_material(solved_material(body, sim.settings)));
    if (material.z != 3)
      material.w = float(sim.system.present[index_of<Stretch>] + 2 * sim.system.present[index_of<Volume>]);
    if (!has_own_materials(sim.settings)) break;
  }
  frame.model = sim.model;
  update(frame, sim);
  const auto is_pinned = [&](std::uint32_t v) { return !(sim.inverse_masses[v] > 0); };
  for (const Body& body : sim.model->bodies) {
    const auto vertices =
        std::views::iota(std::uint32_t(body.first_vertex), std::uint32_t(body.first_vertex + body.vertices));
    if (!std::ranges::all_of(vertices, is_pinned))  // a body that is pinned as a whole needs no dots
      std::ranges::copy_if(vertices, std::back_inserter(frame.pinned), is_pinned);
  }
  frame.target = target.framebuffer.id();
  return frame;
}

}  // namespace tetpbd
