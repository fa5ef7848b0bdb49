// Node-centric Jacobi (paper algorithm 2): every vertex gathers the corrections of all constraints on it and moves, in
// one dispatch. A work-group owns a patch of neighbouring vertices; a constraint on the border of patches is evaluated
// in each. Vertices are read from one buffer and written to another.
#include "types.glsl"
#include "double_single.glsl"
#include "quantized.glsl"
layout(local_size_x = GROUP_SIZE) in;
#include "solvers/corrections.glsl"
#include "solvers/multipliers.glsl"
#include "solvers/patch.glsl"

void main() {
  uint lane = gl_LocalInvocationIndex;
  bool exists = group_index() < PATCH_COUNT;
  Chunk chunk = chunk_at(exists ? group_index() : 0u);
  uint i = chunk.first + lane;
  bool mine = exists && lane < chunk.owned;
#if RIGID_CONTACT
  begin_sums(chunk.first);
#endif
  vec3 correction = vec3(0.0);
  if ((phases & PHASE_SOLVE) != 0u) {
    sum_corrections(chunk, exists);
    if (mine) {
      begin_body(i);
      correction = averaged_correction(lane);
    }
  } else {
    barrier();  // Other invocations add to what begin_sums() cleared.
  }
  if (mine) {
    // The vertex is read only now, so that evaluating constraints takes fewer registers.
    Velocity speed;
    if ((phases & (PHASE_PREDICT | PHASE_FINISH)) != 0u) speed = velocities[i];
    advance(i, positions[i], speed, correction);
#if COMPLIANT
    if (params.damping > 0.0 && (phases & PHASE_FINISH) == 0u)
      quantized_out[params.vertex_count + i] = quantized[params.vertex_count + i];
#endif
  }
#if RIGID_CONTACT
  if ((phases & PHASE_FINISH) != 0u) end_sums();
#endif
}
