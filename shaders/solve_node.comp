// Node-centric Jacobi (paper algorithm 2; method.md eqs. 4, 13): $LANES invocations a vertex gather the corrections of all
// constraints on it, of every kind present; the first adds them up and moves the vertex. Places are read from one buffer
// and written to another. Each constraint is evaluated once by each of its vertices. Mode groups takes the constraints of
// one group, and averages by the number of those on the vertex, without ever exceeding the full correction.
#include "types.glsl"
#include "pair.glsl"
#include "places.glsl"
layout(local_size_x = $GROUP) in;
layout(std430, binding = BIND_TABLE) restrict readonly buffer Table { uint table[]; };
#include "vertex.glsl"
#include "constraints/types.glsl"
#include "guards.glsl"
#foreach #include "constraints/$KIND.glsl"
#foreach #include "gather.glsl"

#if $LANES > 1
shared vec3 sums[$GROUP];
#endif

void main() {
  uint me = gl_LocalInvocationIndex;
  uint thread = group_index() * $GROUPu + me;
  uint i = thread / $LANESu, lane = thread % $LANESu;
  bool mine = i < params.vertex_count && lane == 0u;
  Position own;
  Velocity speed;
  if (mine) {
    own = positions[i];
    if ((turn.x & (PHASE_PREDICT | PHASE_FINISH)) != 0u) speed = velocities[i];
  }
  vec3 sum = vec3(0.0);
#if $GROUPED
  uint here = 0u;
#endif
  if (i < params.vertex_count && (turn.x & PHASE_SOLVE) != 0u) {
    ivec4 self = places[i];
    // The first entries of all kinds are on their way before the first one is used.
    uint row = $KINDSu * ((turn.x >> PHASE_BITS) * params.vertex_count + i);
    #foreach uint at_$KIND = table[row + $INDEXu] + lane, end_$KIND = table[row + $KINDSu + $INDEXu];
    #foreach uvec$ARITY entry_$KIND; if (at_$KIND < end_$KIND) entry_$KIND = stream_$KIND[at_$KIND];
#if $GROUPED
    #foreach here += end_$KIND - at_$KIND;  // of lane 0, which begins at the first
#endif
    if (inverse_mass_of(self) > 0.0) {
      #foreach sum += gather_$KIND(i, at_$KIND, end_$KIND, entry_$KIND, self);
    }
  }
#if $LANES > 1
  sums[me] = sum;
  barrier();
  // Four at a time, in an order that does not depend on who is first.
  for (uint reach = $LANESu; reach > 1u;) {
    uint part = max(reach / 4u, 1u);
    if (lane < part) {
      sum = sums[me];
      for (uint other = lane + part; other < reach; other += part) sum += sums[me - lane + other];
      sums[me] = sum;
    }
    reach = part;
    if (reach > 1u) barrier();
  }
#endif
#if $GROUPED
  float share = here > 0u ? min(params.omega / float(here), 1.0) : 0.0;
#else
  float share = own.constraints > 0.0 ? params.omega / own.constraints : 0.0;
#endif
  if (mine) advance(i, own, speed, share > 0.0 ? sum * share : vec3(0.0));
}
