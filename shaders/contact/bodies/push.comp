// Applies the corrections of each contact that meet.comp found. There is an invocation per record; the work-group of
// the last that reads a vertex moves it.
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
// Moves a vertex by its sums and writes the position that its neighbours see.
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
  velocities[i] = Velocity(v.high, velocities[i].work, v.low, 0.0);
#if !IMPLICIT  // BDF2 goes on from the displacement that forces made: from a stopped one it would give back two thirds
               // of the impact velocity
  x = seen_by_neighbours(x, v);
  begin_body(i);
  quantized_out[i] = quantize(x, weight_of(own));
#endif
}
shared uint moving[8u * GROUP_SIZE], moving_count;
// Ends this invocation's reads of the vertices, and lists those for which it was the last.
void release(uvec4 vertices) {
  int readers[4];
  for (uint j = 0u; j < 4u; ++j) readers[j] = atomicAdd(contact_sums[vertices[j]].readers, -1);
  for (uint j = 0u; j < 4u; ++j)
    if (readers[j] == 1 && sharing[shared_at(vertices[j], side)] > 0) moving[atomicAdd(moving_count, 1u)] = vertices[j];
}
void push(uint record) {
  uint s = records[record].item, t = records[record].target;
  if (t == NONE) return;
  uvec4 vertices = contact_vertices(s, t & TARGET);
  Contact m = contact_between(s, t);
  if ((t & INSIDE) != 0u && m.gap > 0.0) m = turn_inside(m);
  if (m.gap < 0.0) {  // not always, because meet.comp may have rounded differently
    vec4 sum = vec4(0.0);
    for (uint j = 0u; j < 4u; ++j) sum += vertex_share(vertices[j], m.weights[j]);
    Stop by = contact_correction(m, sum.xyz, push_most, friction_between(vertices));
    for (uint j = 0u; j < 4u; ++j) correct(vertices[j], m.weights[j], by, sum);
  }
  memoryBarrierBuffer();
  release(vertices);
#if EDGES
  if (item_is_edge(s)) release(vertices_beside(s, t & TARGET));
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
