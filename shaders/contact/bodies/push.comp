// The corrections of each contact that meet.comp found. One invocation per record; the last that asks for a vertex
// moves it.
#include "contact/bodies/pairs.glsl"
#if IMPLICIT
#include "vertex_state.glsl"
#else
#include "quantized.glsl"
#include "solvers/$SCHEME.glsl"
#endif
#include "contact/bodies/formulas.glsl"
#include "contact/bodies/meeting.glsl"
#include "contact/bodies/correct.glsl"
// Moves a vertex by its sums, and what its neighbours see of it.
void move(uint i) {
  vec3 stopped, pushed;
  for (uint c = 0u; c < 3u; ++c) {
    stopped[c] = float(atomicExchange(contact_sums[i].stopped[c], 0)) * (params.quantum / SUM_PARTS);
    pushed[c] = float(atomicExchange(contact_sums[i].pushed[c], 0)) * (params.quantum / SUM_PARTS);
  }
  sharing[shared_at(i, side)] = 0;
  Position own = positions[i];
  if (!(own.inverse_mass > 0.0)) return;
  DoubleSingle x = add_double(DoubleSingle(own.high, own.low), stopped + pushed),
               v = DoubleSingle(velocities[i].high, velocities[i].low);
  v = add_double(v, stopped * params.inverse_h);
  positions[i] = Position(x.high, own.inverse_mass, x.low, own.constraints);
  velocities[i] = Velocity(v.high, 0.0, v.low, 0.0);
#if !IMPLICIT  // the way that BDF2 goes on from stays what forces made it, or a stop takes back two thirds of the
               // velocity that went in
  x = seen_by_neighbours(x, v);
  quantized_out[i] = quantize(x, weight_of(own));
#endif
}
shared uint moving[8u * GROUP_SIZE], moving_count;
// This invocation reads the vertices no more; of which it is the last that does, its work-group moves them.
void leave(uvec4 vertices) {
  int asks[4];
  for (uint j = 0u; j < 4u; ++j) asks[j] = atomicAdd(contact_sums[vertices[j]].asks, -1);
  for (uint j = 0u; j < 4u; ++j)
    if (asks[j] == 1 && sharing[shared_at(vertices[j], side)] > 0) moving[atomicAdd(moving_count, 1u)] = vertices[j];
}
void push(uint record) {
  uint s = records[record].item, t = records[record].target;
  if (t == NONE) return;
  uvec4 vertices = vertices_of(s, t & TARGET);
  Meeting m = meeting_of(s, t);
  if ((t & INSIDE) != 0u && m.gap > 0.0) m = inside(m);
  if (m.gap < 0.0) {  // another program found it, and may round otherwise
    vec4 sum = vec4(0.0);
    for (uint j = 0u; j < 4u; ++j) sum += part_of(vertices[j], m.weights[j]);
    Stop by = meeting_correction(m, sum.xyz, push_most, friction_between(vertices));
    for (uint j = 0u; j < 4u; ++j) correct(vertices[j], m.weights[j], by, sum);
  }
  memoryBarrierBuffer();
  leave(vertices);
#if EDGES
  if (item_is_edge(s)) leave(beside_of(s, t & TARGET));
#endif
}
void main() {
  uint lane = gl_LocalInvocationIndex, record = group_index() * GROUP_SIZE + lane;
  if (lane == 0u) moving_count = 0u;
  barrier();
  if (record < counts.records) push(record);
  memoryBarrierBuffer();
  barrier();
  for (uint j = lane; j < moving_count; j += GROUP_SIZE) move(moving[j]);
}
