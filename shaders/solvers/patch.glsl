// What a work-group does with a patch of constraints (sim/solvers/patches.h): reads its vertices once, evaluates the
// constraints, an invocation each, and adds up the corrections of the vertices it owns in shared memory. Sums are
// integers, so their order does not matter and the result is the same bits every time, however constraints are cut into
// patches. A quantum of them is params.correction_quantum times the vertex's number of constraints, and no correction
// exceeds params.max_correction = 2^30 quanta over that number: no sum can overflow. All of patches.h's words in pairs:
// headers of chunks, their vertices, their records.
layout(std430) restrict readonly buffer Patches { uvec2 patch_words[]; };
#if COMPLIANT
shared ivec4 start_positions[MAX_VERTICES];  // quantized, at the substep's start
#endif
shared ivec4 local_positions[MAX_VERTICES];  // quantized
shared uint global_ids[MAX_VERTICES];
shared float quanta_per_metre[MAX_OWNED];
shared int sums[3 * MAX_OWNED];
// Bytes of a record: its vertices' numbers in the chunk.
uint local_id(uint record, int j) { return (record >> (8 * j)) & 255u; }
// A record's words: its vertices, values at rest, compliances of a material, k and damping of a body's own.
float record_value(uint number, uint word) {
  return uintBitsToFloat(patch_words[RECORDS_AT + number + word / 2u][word % 2u]);
}
#define Ids uint
uint id_of(Ids record, int j) { return global_ids[local_id(record, j)]; }
#include "constraints/types.glsl"
#foreach #include "constraints/$KIND.glsl"

#if COUNT_GUARDS
layout(binding = BIND_GUARDS) uniform atomic_uint guard_counts[GUARDS];
// Counts the guards that triggered, where a run asks for it.
void count_guards(uint guards) {
  if (guards == 0u) return;
  if ((guards & GUARD_DIRECTION) != 0u) atomicCounterIncrement(guard_counts[0]);
  if ((guards & GUARD_HINGE) != 0u) atomicCounterIncrement(guard_counts[1]);
  if ((guards & GUARD_ANGLE) != 0u) atomicCounterIncrement(guard_counts[2]);
  if ((guards & GUARD_FLOOR) != 0u) atomicCounterIncrement(guard_counts[3]);
  if ((guards & GUARD_COLLAPSED) != 0u) atomicCounterIncrement(guard_counts[4]);
  if ((guards & GUARD_LIMIT) != 0u) atomicCounterIncrement(guard_counts[5]);
  if ((guards & GUARD_NOT_FINITE) != 0u) atomicCounterIncrement(guard_counts[6]);
}
#endif
#foreach #include "solvers/$PROJECT.glsl"

// A patch is one chunk, or more where its vertices are too many for one; those it owns come first in each.
struct Chunk {
  uint number;
  uint vertices;  // of which the first are
  uint owned;
  uint first;     // global id of the first owned one (mode node)
  uint next;      // chunk of the patch; 0: none
};
Chunk chunk_at(uint number) {
  uvec2 counts = patch_words[CHUNK_PAIRS * number], links = patch_words[CHUNK_PAIRS * number + 1];
  return Chunk(number, counts.x, counts.y, links.x, links.y);
}

void clear_sums() {
  for (uint k = gl_LocalInvocationIndex; k < 3 * MAX_OWNED; k += GROUP_SIZE) sums[k] = 0;
}
/// A chunk's vertices as their neighbours see them. Needs a barrier behind it.
void load_chunk(uint number) {
  // Every chunk has room for as many vertices, so that none waits for its words before it looks for them.
  for (uint k = gl_LocalInvocationIndex; k < MAX_VERTICES; k += GROUP_SIZE) {
    uvec2 vertex = patch_words[VERTICES_AT + MAX_VERTICES * number + k];
    global_ids[k] = vertex.x;
    local_positions[k] = quantized[vertex.x];
#if COMPLIANT
    if (params.damping > 0.0) start_positions[k] = quantized[params.vertex_count + vertex.x];
#endif
    if (k < MAX_OWNED) quanta_per_metre[k] = 1.0 / (params.correction_quantum * uintBitsToFloat(vertex.y));
  }
}
/// Adds the corrections of a chunk that is loaded; `exists`: whether there is one. Needs a barrier behind it.
void project_chunk(Chunk chunk, bool exists) {
  #foreach uvec2 records_$KIND = patch_words[CHUNK_PAIRS * chunk.number + 2 + $INDEX];  // the first, and how many
  // Each kind begins with a warp of its own.
  uint end = 0u, owned = chunk.owned;
  #foreach uint begin_$KIND = end, count_$KIND = exists ? records_$KIND.y : 0u; end = (end + count_$KIND + 31u) & ~31u;
  for (uint t = gl_LocalInvocationIndex; t < end; t += GROUP_SIZE) {
    #foreach if (t - begin_$KIND < count_$KIND) project_$KIND(records_$KIND.x + $PAIRS * (t - begin_$KIND), owned);
  }
}
