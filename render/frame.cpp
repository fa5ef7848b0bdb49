#include "render/frame.h"

namespace tetpbd {

Frame frame_of(const Sim& sim, const Camera& camera, const ViewOptions& options, const Target& target) {
  Frame frame;
  frame.positions = sim.current_positions().id();
  frame.velocities = sim.velocities.id();
  frame.camera = camera;
  frame.viewport = {0, 0, target.width, target.height};
  frame.options = options;
  if (sim.settings.ground) frame.ground = float(sim.settings.ground_height);
  for (const glm::dvec4& plane : sim.model->obstacles) frame.planes.emplace_back(plane);
  for (std::uint32_t v = 0; v < sim.inverse_masses.size(); ++v)
    if (!(sim.inverse_masses[v] > 0)) frame.pinned.push_back(v);
  frame.target = target.framebuffer.id();
  return frame;
}

}  // namespace tetpbd
