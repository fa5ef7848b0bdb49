// Finds the vertex of the surface that a ray hits, on the GPU, read back without waiting.
#pragma once

#include <cstdint>
#include <optional>

#include "render/renderer.h"
#include "sim/gl/gpu.h"
#include "sim/mesh/tet_mesh.h"

namespace tetpbd {

struct Pick {
  bool hit = false;
  bool inside = false;        ///< a tetrahedron was requested, not a triangle
  std::uint32_t element = 0;  ///< index into TetMesh::surface or tets; the lowest of those equally near
  std::uint32_t vertex = 0;   ///< its corner nearest to the hit
  float distance = 0;         ///< m, along the ray
  Ray ray;                    ///< the ray of the request
};

/// A picker handles one request at a time: a new one replaces one whose result has not arrived.
struct Picker {
  Recorder recorder;
  Pass kernel, tets_kernel;  ///< the latter made when first needed
  bool inside = false;
  Buffer triangles, result;
  Ray ray;
  Fence requested;
};

Picker make_picker(const TetMesh& mesh);
/// Requests a triangle.
void request(Picker& picker, GLuint positions, const Ray& ray);
/// Requests what the frame shows: a tetrahedron where it shows these or is cut, else a triangle.
void request(Picker& picker, Renderer& renderer, const Frame& frame, const Ray& ray);
/// The result of the last request, once, as soon as it has arrived; with `wait`, waits for it.
std::optional<Pick> poll(Picker& picker, bool wait = false);

}  // namespace tetpbd
