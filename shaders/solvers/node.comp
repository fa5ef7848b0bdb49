// Node-centric Jacobi (paper algorithm 2): every vertex gathers the corrections of all constraints on it, of every kind
// present, and moves, in one dispatch. A work-group owns a patch of neighbouring vertices and evaluates each constraint
// that has one of them; one on the border of patches is evaluated in each. Vertices are read from one buffer and
// written to another.
#include "types.glsl"
#include "double_single.glsl"
#include "quantized.glsl"
layout(local_size_x = GROUP_SIZE) in;
#include "solvers/corrections.glsl"
#include "solvers/multipliers.glsl"
#include "solvers/patch.glsl"

void main() {
  uint lane = gl_LocalInvocationIndex;
  bool exists = group_index() < PATCH_COUNT, solves = (phases & PHASE_SOLVE) != 0u;
  Chunk chunk = chunk_at(exists ? group_index() : 0u);
  uint i = chunk.first + lane, owned = exists ? chunk.owned : 0u;
  bool mine = lane < owned;

  // Gather: the sum of all corrections on a vertex, over their number, times omega (method.md eqs. 4, 13).
  if (solves) {
    clear_sums();
    load_chunk(chunk.number);
  }
#if RIGID_CONTACT
  begin_sums(chunk.first);
#endif
  barrier();
  vec3 correction = vec3(0.0);
  if (solves) {
    project_chunk(chunk, exists);
    barrier();
#if CHUNKED
    for (uint next = chunk.next; next != 0u; next = chunk_at(next).next) {
      load_chunk(next);
      barrier();
      project_chunk(chunk_at(next), exists);
      barrier();
    }
#endif
    if (mine)
      correction = vec3(sums[3u * lane], sums[3u * lane + 1u], sums[3u * lane + 2u]) *
                   (params.correction_quantum * params.omega);
  }

  // Move: prediction before the first iteration of a substep, contacts in each, velocity after the last (eqs. 1-2, 5,
  // 11-13).
  if (mine) {  // read here only: fewer registers while constraints are evaluated
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
