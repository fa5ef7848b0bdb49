// What is under the cursor: a vertex, its tetrahedron and what they measure, read back without waiting.
#pragma once

#include <array>
#include <optional>

#include "app/window/lanes.h"
#include "render/picking.h"

namespace tetpbd {

struct TetValues {
  float volume, strain, energy;  ///< V/V0 - 1, the mean L/L0 - 1, J/m^3 (0 without a material)
};
/// Of a tet with these corners (m); `material` as energy_material() gives it.
TetValues tet_values(const Model& model, std::size_t tet, const std::array<glm::dvec3, 4>& corners,
                     const glm::vec4& material);

/// J/m^3, what the averages around a vertex of smoothed tets store.
float average_energy(const Averages& averages, std::size_t vertex, const std::vector<glm::dvec3>& positions,
                     const glm::vec4& material);

struct Reading {
  std::uint32_t vertex = 0, tet = 0;
  glm::dvec3 position{0};         ///< m
  double speed = 0;               ///< m/s
  double volume = 0, strain = 0;  ///< V/V0 - 1, of smoothed tets around the vertex; the mean L/L0 - 1 of the tet
  std::optional<double> energy{}, distance{};  ///< J/m^3, where there is a material; from what is right, over the size
};

/// One question at a time: first which, then what.
struct Probe {
  Picker picker;  ///< made when first asked
  Buffer copy;    ///< of what the vertices have, on its way back
  Fence copied;
  Reading next;
  std::vector<std::uint32_t> read;  ///< vertices whose positions are copied: the tet's, then smoothed neighbours
  std::size_t lane = 0;
  std::optional<Reading> reading;  ///< the last; none beside the bodies
  bool asked() const { return bool(picker.requested) || bool(copied); }
};

/// Replaces a question that has not been answered.
void ask(Probe& probe, const std::vector<Lane>& lanes, std::size_t lane, Renderer& renderer, const Frame& frame,
         const Ray& ray);
/// Takes in what has arrived; whether there is a new reading, or none now. With `wait`: waits for it.
bool take_reading(Probe& probe, const std::vector<Lane>& lanes, bool wait = false);

}  // namespace tetpbd
