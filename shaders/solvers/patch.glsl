// A work-group and its patch of constraints (sim/solvers/patches.h): it reads the patch's vertices once, evaluates one
// constraint an invocation, and adds up the corrections of the vertices that the patch owns in shared memory. Sums are
// integers, so that neither their order nor the way constraints are cut into patches changes a bit.

#include "solvers/guards.glsl"
#include "solvers/records.glsl"
#if COMPLIANT
shared ivec4 start_positions[MAX_VERTICES];  // quantized, at the substep's start
#endif
shared ivec4 local_positions[MAX_VERTICES];  // quantized
shared uint global_ids[MAX_VERTICES];
// A quantum of a sum is params.correction_quantum times the vertex's number of constraints. No correction exceeds
// params.max_correction, which is 2^30 quanta over that number. Sums may wrap on the way, where forces of averages
// cancel, but end in range.
shared float quanta_per_metre[MAX_OWNED];
shared int sums[3 * MAX_OWNED];
#if AVERAGED
layout(std430) restrict readonly buffer Averages { vec4 averages[]; };  // as smooth.comp leaves them
shared float averages_of_J[MAX_VERTICES];
float mean_J(uint record) {
  float sum = 0.0;
  for (int j = 0; j < 4; ++j) sum += averages_of_J[local_id(record, j)];
  return 0.25 * sum;
}
#endif
#define Ids uint
uint id_of(Ids record, int j) { return global_ids[local_id(record, j)]; }
// What project.glsl reads of a vertex.
#define Place ivec4
ivec4 place_of(uint record, int j) { return local_positions[local_id(record, j)]; }
#if COMPLIANT
ivec4 start_of(uint record, int j) { return start_positions[local_id(record, j)]; }
#endif
#include "constraints/types.glsl"
#foreach #include "constraints/$KIND.glsl"

// Several patches may have the same constraint: the one that owns its first vertex counts the guards that triggered.
void count_guards(uint record, uint owned, uint guards) {
  if (local_id(record, 0) < owned) count_guards(guards);
}
void add_correction(uint local, uint owned, vec3 correction) {
  if (local >= owned) return;
  ivec3 quanta = ivec3(round(correction * quanta_per_metre[local]));
  for (uint axis = 0u; axis < 3u; ++axis) atomicAdd(sums[3u * local + axis], quanta[axis]);
}
#foreach #include "solvers/$PROJECT.glsl"
#if AVERAGED
#include "rings.glsl"
// Adds the forces of averages on the owned vertices, RING_LANES invocations for each.
void add_ring_forces(uint first, uint owned) {
  for (uint t = gl_LocalInvocationIndex; t < RING_LANES * owned; t += GROUP_SIZE) {
    uint local = t / RING_LANES, i = first + local;
    Ring ring = ring_of(i);
    uint k = ring.first_neighbour + 2u * (t % RING_LANES);
    if (k >= ring.end_neighbour) continue;
    begin_body(i);
    mat3 own = MATRIX_OF(averages, i);
    vec3 force = vec3(0.0);
    for (; k < ring.end_neighbour; k += 2u * RING_LANES) {
      RingNeighbour n = ring_neighbour(k);
      force += own * n.own - MATRIX_OF(averages, n.vertex) * n.other;
    }
    add_correction(local, owned, limited(force * (inverse_mass_of(local_positions[local]) * params.h * params.h)));
  }
}
#endif

// Every chunk has room for as many vertices, so that no load of a vertex waits for the chunk's header.
void load_chunk(uint number) {
  for (uint k = gl_LocalInvocationIndex; k < MAX_VERTICES; k += GROUP_SIZE) {
    uvec2 vertex = patch_words[VERTICES_AT + MAX_VERTICES * number + k];
    global_ids[k] = vertex.x;
    local_positions[k] = quantized[vertex.x];
#if AVERAGED
    averages_of_J[k] = averages[3u * vertex.x].w;
#endif
#if COMPLIANT
    if (params.damping > 0.0) start_positions[k] = quantized[params.vertex_count + vertex.x];
#endif
    if (k < MAX_OWNED)
      quanta_per_metre[k] = 1.0 / (FINE_AT(params.correction_quantum, vertex.x) * uintBitsToFloat(vertex.y));
  }
}
// Adds the corrections of a loaded chunk's constraints, where there is such a chunk.
void project_chunk(Chunk chunk, bool exists) {
  #foreach uvec2 records_$KIND = patch_words[CHUNK_PAIRS * chunk.number + 2 + $INDEX];  // the first, and how many
  // Each kind begins with a warp of its own.
  uint end = 0u, owned = chunk.owned;
  #foreach uint begin_$KIND = end, count_$KIND = exists ? records_$KIND.y : 0u; end = (end + count_$KIND + 31u) & ~31u;
  for (uint t = gl_LocalInvocationIndex; t < end; t += GROUP_SIZE) {
    #foreach if (t - begin_$KIND < count_$KIND) project_$KIND(records_$KIND.x + $PAIRS * (t - begin_$KIND), owned);
  }
}
// Fills `sums` with the corrections of a patch's constraints, in all of its chunks.
void sum_corrections(Chunk chunk, bool exists) {
  for (uint k = gl_LocalInvocationIndex; k < 3 * MAX_OWNED; k += GROUP_SIZE) sums[k] = 0;
  load_chunk(chunk.number);
  barrier();
  project_chunk(chunk, exists);
#if AVERAGED
  if (exists) add_ring_forces(chunk.first, chunk.owned);
#endif
  barrier();
#if CHUNKED
  for (uint next = chunk.next; next != 0u; next = chunk_at(next).next) {
    load_chunk(next);
    barrier();
    project_chunk(chunk_at(next), exists);
    barrier();
  }
#endif
}
// The sum of all corrections of an owned vertex, over their number, times omega (method.md eqs. 6, 13). The
// vertex's body has begun.
vec3 averaged_correction(uint local) {
  return vec3(sums[3u * local], sums[3u * local + 1u], sums[3u * local + 2u]) *
         (FINE(params.correction_quantum) * params.omega);
}
