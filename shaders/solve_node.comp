// Node-centric Jacobi (paper algorithm 2; method.md eqs. 4, 13): every vertex gathers the corrections of all constraints on it, of every
// kind present, in one dispatch. A work-group owns a patch of neighbouring vertices and evaluates each constraint that has one of
// them; one on the border of patches is evaluated in each. Places are read from one buffer and written to another. Mode groups takes
// the constraints of one group, and averages by the number of those on the vertex, without ever exceeding the full correction.
#include "types.glsl"
#include "pair.glsl"
#include "places.glsl"
layout(local_size_x = $GROUP) in;
#include "vertex.glsl"
#include "patch.glsl"
#if $HANDLES
#include "handles.glsl"
#endif

void main() {
  uint me = gl_LocalInvocationIndex;
  bool some = group_index() < $PATCHESu;
  uint part = some ? ((turn.x >> PHASE_BITS) & 127u) * $PATCHESu + group_index() : 0u;
  uint i = parts[$PART_WORDSu * part + 2u] + me;
  uint count = some ? parts[$PART_WORDSu * part + 1u] : 0u;
  bool mine = me < count;
  vec3 correction = vec3(0.0);
  bool solves = (turn.x & PHASE_SOLVE) != 0u;
#if $HANDLES
  load_handles(group_index(), i - me, count);
#endif
  if (solves) {
    clear_sums();
    load_part(part);
  }
  barrier();
#if $HANDLES
  find_poses();  // while others evaluate constraints
  if (!solves) barrier();
#endif
  if (solves) {
    float share = params.omega;
#if $GROUPED
    share = min(share, uintBitsToFloat(vertices[$VERTICESu * part + (mine ? me : 0u)].y));
#endif
    project_part(part, some);
    barrier();
#if $PARTED
    for (uint next = parts[$PART_WORDSu * part + 3u]; next != 0u; next = parts[$PART_WORDSu * next + 3u]) solve_part(next, some);
#endif
    if (mine) correction = vec3(sums[3u * me], sums[3u * me + 1u], sums[3u * me + 2u]) * (params.delta_unit * share);
#if $HANDLES
    correction += params.handles * handle_pull(i - me, count);
#endif
  }
  if (mine) {  // read here only: fewer registers while constraints are evaluated
    ivec4 place = places[i];
    if ((turn.x & PHASE_PLACES) != 0u) {
      places_out[i] = place;
    } else {
      Velocity speed;
      if ((turn.x & (PHASE_PREDICT | PHASE_FINISH)) != 0u) speed = velocities[i];
      place = advance(i, positions[i], speed, correction);
    }
#ifdef DAMPED
    if ((turn.x & PHASE_FINISH) == 0u) places_out[params.vertex_count + i] = places[params.vertex_count + i];
#endif
#if $HANDLES
    here[me] = place;
#endif
  }
#if $HANDLES
  add_to_handles(group_index(), count);
#endif
}
