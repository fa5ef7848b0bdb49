// Which vertex of the surface a ray meets, found on the GPU, read back without waiting.
#pragma once

#include <cstdint>
#include <optional>

#include "render/renderer.h"
#include "sim/gl/gpu.h"
#include "sim/mesh/tet_mesh.h"

namespace tetpbd {

struct Pick {
  bool hit = false;
  bool inside = false;        ///< a tetrahedron was asked for, not a triangle
  std::uint32_t element = 0;  ///< index into TetMesh::surface or tets; the lowest of those equally near
  std::uint32_t vertex = 0;   ///< its corner nearest to the hit
  float distance = 0;         ///< metres along the ray
  Ray ray;                    ///< the one asked for
};

/// One question at a time: a new one replaces one that has not been answered.
struct Picker {
  Recorder recorder;
  Pass kernel, tets_kernel;  ///< the latter made when first asked for
  bool inside = false;
  Buffer triangles, result;
  Ray ray;
  Fence answered;
};

Picker make_picker(const TetMesh& mesh);
void request(Picker& picker, GLuint positions, const Ray& ray);
/// Of what the frame shows: of tetrahedra where it shows these or is cut.
void request(Picker& picker, Renderer& renderer, const Frame& frame, const Ray& ray);
/// The answer, once, when it has arrived (with `wait`: now); none when nothing was asked.
std::optional<Pick> poll(Picker& picker, bool wait = false);

}  // namespace tetpbd
