// Mode explicit (method.md eq. 32): every vertex gathers the forces of its constraints and moves, in one dispatch.
// A work-group owns a patch of neighbouring vertices; a constraint on the border of patches is evaluated in each.
// Vertices are read from one buffer and written to another. Where tets are smoothed, smooth.comp comes before.
#include "types.glsl"
#include "double_single.glsl"
#include "quantized.glsl"
layout(local_size_x = GROUP_SIZE) in;
#include "solvers/leapfrog.glsl"
// A projection of infinite softness is a force, so no multiplier is kept from one to the next.
float last_multiplier(uint record) { return 0.0; }
void keep_multiplier(uint record, float lambda) {}
// The largest h^2 b of the work-group's constraints (method.md eq. 34).
shared uint stiffest_here;
#define NOTE_STIFFNESS(value) if ((phases & PHASE_WATCH) != 0u) atomicMax(stiffest_here, floatBitsToUint(value))
#include "solvers/patch.glsl"
void main() {
  uint lane = gl_LocalInvocationIndex;
  bool exists = group_index() < PATCH_COUNT;
  Chunk chunk = chunk_at(exists ? group_index() : 0u);
  uint i = chunk.first + lane;
  if (lane == 0u) stiffest_here = 0u;
  sum_corrections(chunk, exists);
  if (lane == 0u && (phases & PHASE_WATCH) != 0u) atomicMax(largest, stiffest_here);
  if (!exists || lane >= chunk.owned) return;
  begin_body(i);
  advance(i, positions[i], velocities[i], averaged_correction(lane));
}
