// What a work-group does with a patch of constraints (sim/patches.h): reads the places of its vertices once, evaluates the constraints, an
// invocation each, and adds up the corrections of summed vertices in shared memory. Sums are integers, so their order does not
// matter and the result is the same bits every time, however constraints are cut into patches. A unit is params.delta_unit times the
// vertex's number of constraints, and no correction exceeds params.limit = 2^30 units over that number: no sum can overflow.
layout(std430, binding = BIND_PARTS) restrict readonly buffer Parts { uint parts[]; };
layout(std430, binding = BIND_PATCH_VERTICES) restrict readonly buffer PatchVertices { uvec2 vertices[]; };
layout(std430, binding = BIND_PATCH_RECORDS) restrict readonly buffer Records { uvec2 records[]; };
shared ivec4 here[$HERE];
shared uint names[$VERTICES];
shared float units_per_metre[$SUMMED];
shared int sums[3 * $SUMMED];
// Bytes of a record: its vertices' numbers in the patch.
uint slot_of(uint slots, int j) { return (slots >> (8 * j)) & 255u; }
#ifdef COMPLIANT
layout(std430, binding = BIND_MULTIPLIERS) restrict buffer Multipliers { float multipliers[]; };  // of records, in this substep
uint at_record;  // the index of the one being projected
#if $GROUPED
shared float counts[$VERTICES];  // n_i in the group
#endif
#ifdef DAMPED
shared ivec4 starts[$VERTICES];  // places at the substep's start
#endif
#endif
#define Ids uint
uint id_of(Ids slots, int j) { return names[slot_of(slots, j)]; }
#include "constraints/types.glsl"
#ifdef COMPLIANT
#include "constraints/compliance.glsl"
#endif
#include "guards.glsl"
#foreach #include "constraints/$KIND.glsl"
#foreach #include "project.glsl"

void clear_sums() {
  for (uint k = gl_LocalInvocationIndex; k < 3u * $SUMMEDu; k += $GROUPu) sums[k] = 0;
}
/// The places of a part's vertices; `part`: its index in parts[]. Needs a barrier behind it.
void load_part(uint part) {
  // Every part has room for as many vertices, so that none waits for its words before it looks for them.
  for (uint k = gl_LocalInvocationIndex; k < $VERTICESu; k += $GROUPu) {
    uvec2 vertex = vertices[$VERTICESu * part + k];
    names[k] = vertex.x;
    here[k] = places[vertex.x];
#ifdef COMPLIANT
#if $GROUPED
    counts[k] = uintBitsToFloat(vertex.y);
    here[k].w = floatBitsToInt(inverse_mass_of(here[k]) * counts[k]);
#endif
#ifdef DAMPED
    starts[k] = places[params.vertex_count + vertex.x];
#endif
#endif
    if (k < $SUMMEDu) units_per_metre[k] = 1.0 / (params.delta_unit * uintBitsToFloat(vertex.y));
  }
}
/// Adds the corrections of a part that is loaded; `some`: whether there is one. Needs a barrier behind it.
void project_part(uint part, bool some) {
  uint me = gl_LocalInvocationIndex, row = $PART_WORDSu * part;
  uint summed = parts[row + 1u];
  #foreach uint from_$KIND = parts[row + 4u + 2u * $INDEXu], count_$KIND = some ? parts[row + 5u + 2u * $INDEXu] : 0u;
  // Each kind begins with a warp of its own.
  uint end = 0u;
  #foreach uint begin_$KIND = end; end = (end + count_$KIND + 31u) & ~31u;
  for (uint t = me; t < end; t += $GROUPu) {
#ifdef COMPLIANT
    #foreach if (t - begin_$KIND < count_$KIND) at_record = from_$KIND + (t - begin_$KIND);
#endif
    #foreach if (t - begin_$KIND < count_$KIND) project_$KIND(records[from_$KIND + (t - begin_$KIND)], summed);
  }
}
/// All invocations of a work-group call it; sums are complete when it returns.
void solve_part(uint part, bool some) {
  load_part(part);
  barrier();
  project_part(part, some);
  barrier();
}
