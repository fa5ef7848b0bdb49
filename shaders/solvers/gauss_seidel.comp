// Gauss-Seidel by colours (method.md, mode gauss-seidel; Ton-That, Kry and Andrews 2022), every kind present in one
// dispatch. An invocation solves the constraints of a cluster one after the other, and each moves its vertices in place
// before the next one reads them. The clusters of a dispatch, which are of one colour, share no vertex.
#include "types.glsl"
#include "double_single.glsl"
layout(local_size_x = GROUP_SIZE) in;
#define WITHOUT_CHECK
#include "vertex_state.glsl"
#include "solvers/multipliers.glsl"
#include "solvers/guards.glsl"
#include "solvers/records.glsl"
uniform uint first_cluster, end_cluster;  // of the colour
uint first_vertex;  // of the cluster, among those of all

// What project.glsl asks for: positions in full, where mode node has quantized ones in shared memory.
#define Ids uint
uint global_id(uint local) { return patch_words[first_vertex + local].x; }
uint id_of(Ids record, int j) { return global_id(local_id(record, j)); }
#define Place Position
Position place_of(uint record, int j) { return positions[id_of(record, j)]; }
vec3 between(Position a, Position b) { return relative(a, b); }
float inverse_mass_of(Position own) { return own.inverse_mass; }
#if COMPLIANT
// Where the vertex was before it was predicted, h v short of that place. Of fixed vertices, lead.comp has moved some.
Position start_of(uint record, int j) {
  uint i = id_of(record, j);
  Position there = positions[i];
  Velocity v = velocities[i];
  if (there.inverse_mass > 0.0) {
    Velocity predicted = velocities[params.vertex_count + i];
    there.high = predicted.high, there.low = predicted.low;
  }
  DoubleSingle start = add_double(DoubleSingle(there.high, there.low), -params.h * v.high);
  return Position(start.high, there.inverse_mass, start.low, there.constraints);
}
#endif
#include "constraints/types.glsl"
#foreach #include "constraints/$KIND.glsl"

void count_guards(uint record, uint owned, uint guards) { count_guards(guards); }
void add_correction(uint local, uint owned, vec3 correction) {
  uint i = global_id(local);
  Position own = positions[i];
  if (!(own.inverse_mass > 0.0)) return;
  DoubleSingle x = add_double(DoubleSingle(own.high, own.low), correction);
  positions[i].high = x.high, positions[i].low = x.low;
}
#foreach #include "solvers/$PROJECT.glsl"

void main() {
  uint number = first_cluster + group_index() * GROUP_SIZE + gl_LocalInvocationIndex;
  if (number >= end_cluster) return;
  first_vertex = VERTICES_AT + MAX_VERTICES * number;
  #foreach uvec2 records_$KIND = patch_words[CHUNK_PAIRS * number + 2 + $INDEX];  // the first, and how many
  #foreach for (uint c = 0u; c < records_$KIND.y; ++c) project_$KIND(records_$KIND.x + $PAIRS * c, MAX_VERTICES);
}
