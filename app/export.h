// What a run leaves for other programs: arrays, and frames for ParaView, Blender and whoever reads PLY; in
// the meshes' order of vertices.
#pragma once

#include <array>
#include <filesystem>
#include <optional>

#include "app/files.h"
#include "sim/sim.h"

namespace tetpbd {

struct RunOptions;

inline constexpr std::array export_formats{"vtk", "pc2", "ply"};

/// Of the state now: positions, velocities; rest (positions), tets, faces, bodies (of vertices); where a fine
/// surface rides on the tets also surface and surface_faces.
void write_arrays(const Sim& sim, const std::filesystem::path& folder);

/// Frames that a run writes as it goes. What grows with each is a whole file after close().
struct Export {
  std::filesystem::path folder;
  bool vtk, ply;
  long every;                                    ///< steps
  long count = 0;                                ///< frames so far
  std::string times;                             ///< of vtk's frames, for frames.pvd
  std::optional<GrowingFile> trajectory, cache;  ///< .npy; .pc2
  std::size_t surface_vertices = 0;
  Export(const Sim& sim, const RunOptions& options);
};
/// Of the state now.
void add_frame(Export& files, const Sim& sim);
void close(Export& files, const Sim& sim);

}  // namespace tetpbd
