// The corrections of each contact, with masses split among the contacts of a vertex, so that momentum is kept. One invocation per record; the last that
// asks for a vertex moves it.
#include "pairs/pairs.glsl"
#if IMPLICIT
#include "vertex_state.glsl"
#else
#include "quantized.glsl"
#include "vertex.glsl"
#endif
#include "pairs/formulas.glsl"
#include "pairs/meeting.glsl"
const float push_most = EDGE / 10.0;  // m, in a substep: so bodies that are deep in each other leave each other
void add(uint i, uint at, vec3 correction) {
  ivec3 quanta = ivec3(round(clamp(correction, -params.body_size / PARTS, params.body_size / PARTS) * (params.inverse_quantum * PARTS)));
  for (uint c = 0u; c < 3u; ++c)
    if (quanta[c] != 0) atomicAdd(pair_sums[8u * i + at + c], quanta[c]);
}
// Moves a vertex by its sums, and what its neighbours see of it.
void move(uint i) {
  vec3 stopped, pushed;
  for (uint c = 0u; c < 3u; ++c) {
    stopped[c] = float(atomicExchange(pair_sums[8u * i + c], 0)) * (params.quantum / PARTS);
    pushed[c] = float(atomicExchange(pair_sums[8u * i + 4u + c], 0)) * (params.quantum / PARTS);
  }
  pair_sums[8u * i + 3u] = 0;
  Position own = positions[i];
  if (!(own.inverse_mass > 0.0)) return;
  Pair x = pair_add(Pair(own.high, own.low), stopped + pushed), v = Pair(velocities[i].high, velocities[i].low);
  v = pair_add(v, stopped * params.inverse_h);
  positions[i] = Position(x.high, own.inverse_mass, x.low, own.constraints);
  velocities[i] = Velocity(v.high, 0.0, v.low, 0.0);
#if !IMPLICIT  // the way that BDF2 goes on from stays what forces made it, or a stop takes back two thirds of the velocity that went in
#if !LEAPFROG
  x = predict_position(x, predict_velocity(v));
#endif
  quantized_out[i] = quantize(x, weight_of(own));
#endif
}
shared uint moving[8u * GROUP_SIZE], moving_count;
// This invocation reads the vertex no more; if it is the last that does, its work-group moves it.
void leave(uint i) {
  if (atomicAdd(pair_sums[8u * i + 7u], -1) == 1 && pair_sums[8u * i + 3u] > 0) moving[atomicAdd(moving_count, 1u)] = i;
}
void push(uint k) {
  uint s = pair_lists[k], t = pair_lists[k + 1u];
  if (t == NONE) return;
  uvec4 vertices = vertices_of(s, t & TARGET);
  Meeting m = meeting_of(s, t);
  vec3 way = vec3(0.0);
  float weight = 0.0;
  for (uint j = 0u; j < 4u; ++j) {
    way += m.weights[j] * params.h * velocities[vertices[j]].high;
    weight += m.weights[j] * m.weights[j] * positions[vertices[j]].inverse_mass * float(pair_sums[8u * vertices[j] + 3u]);
  }
  if (weight > 0.0 && m.gap < 0.0) {  // another program found it, and may round otherwise
    Stop by = meeting_correction(m, way, push_most, params.friction);
    for (uint j = 0u; j < 4u; ++j) {
      if (m.weights[j] == 0.0) continue;
      float factor = m.weights[j] * positions[vertices[j]].inverse_mass / weight;
      add(vertices[j], 0u, factor * by.stopped);
      add(vertices[j], 4u, factor * by.pushed);
    }
  }
  memoryBarrierBuffer();
  for (uint j = 0u; j < 4u; ++j) leave(vertices[j]);
#if EDGES
  uvec4 beside = beside_of(s, t & TARGET);
  if (item_is_edge(s))
    for (uint j = 0u; j < 4u; ++j) leave(beside[j]);
#endif
}
void main() {
  uint lane = gl_LocalInvocationIndex, record = group_index() * GROUP_SIZE + lane;
  if (lane == 0u) moving_count = 0u;
  barrier();
  if (record < pair_lists[RECORDS]) push(RECORDS_AT + RECORD * record);
  memoryBarrierBuffer();
  barrier();
  for (uint j = lane; j < moving_count; j += GROUP_SIZE) move(moving[j]);
}
