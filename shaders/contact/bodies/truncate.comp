// Moves the vertices of pairs by what pairs do to them, and stops them before they cross: each side of a pair may go a
// part of the gap between them. There is an invocation per pair; the work-group of the last that asks for a vertex
// moves it.
#include "types.glsl"
#include "double_single.glsl"
layout(local_size_x = PAIR_GROUP) in;
#include "contact/bodies/pairs.glsl"
#include "contact/moved.glsl"
layout(binding = UNIT_LISTED) uniform samplerBuffer listed_places;
uniform uint side;
shared uint moving[4u * PAIR_GROUP], moving_count;
vec3 stopped_by(uint i) {
  return in_metres(pair_sums[i].stopped[0], pair_sums[i].stopped[1], pair_sums[i].stopped[2]);
}
vec3 pushed_by(uint i) { return in_metres(pair_sums[i].pushed[0], pair_sums[i].pushed[1], pair_sums[i].pushed[2]); }
#if RIGID_CONTACT
#include "contact/bodies/hard.glsl"
vec3 placed_by(uint i) {
  uint b = hard_body_of(i);
  if (b != NONE) return hard_motion(b, arm_at_start(b, i, way_of(i)));
  return stopped_by(i) + pushed_by(i);
}
#else
uint hard_body_of(uint i) { return NONE; }
vec3 placed_by(uint i) { return stopped_by(i) + pushed_by(i); }
#endif
bool is_soft(SurfacePair pair) {
  return hard_body_of(pair.vertices[0]) == NONE && hard_body_of(pair.vertices[3]) == NONE;
}
// Makes a vertex, or all of its body where that is rigid, go a part of its way.
void cut(uint i, float part) {
#if RIGID_CONTACT
  uint b = hard_body_of(i);
  if (b != NONE) {
    atomicMin(rigid_bodies[b].hard.part, floatBitsToUint(part));
    return;
  }
#endif
  atomicMin(pair_sums[i].part, floatBitsToUint(part));
}
void turn(SurfacePair pair) {
  PairState s = state_of(pair.vertices);
  if (!s.turns) return;
  Proximity t = proximity_of(s.places, (pair.first & OF_EDGES) != 0u);
  vec3 way = vec3(0.0);
  for (int k = 0; k < 4; ++k) way += t.weights[k] * (s.ways[k] + stopped_by(pair.vertices[k]));
  for (int k = 0; k < 4; ++k) {
    ivec3 turned = to_quanta(s.weights[k] * push_turn(k, t, way, pair.push));
    for (int c = 0; c < 3; ++c)
      if (turned[c] != 0) atomicAdd(pair_sums[pair.vertices[k]].turned[c], turned[c]);
  }
}
void limit_ways(SurfacePair pair) {
  int own = (pair.first & OF_EDGES) != 0u ? 2 : 1;
  vec3 n = pair.normal.xyz;
  float approaches[4];
  vec2 sides = vec2(0.0);
  for (int k = 0; k < 4; ++k) {
    uint i = pair.vertices[k];
    approaches[k] = (k < own ? -1.0 : 1.0) * dot(n, way_of(i) + placed_by(i));
    if (k < own) sides.x = max(sides.x, approaches[k]);
    else sides.y = max(sides.y, approaches[k]);
  }
  Proximity t;
  t.distance = pair.normal.w;
  for (int k = 0; k < 4; ++k) {
    float part = allowed_part(t, pair.offset, sides, k < own ? 0 : 1, approaches[k]);
    if (part < 1.0) cut(pair.vertices[k], part);
  }
}
vec3 taken(uint i, int which) {
  ivec3 sum;
  for (int c = 0; c < 3; ++c)
    sum[c] = which == 0 ? atomicExchange(pair_sums[i].stopped[c], 0)
             : which == 1 ? atomicExchange(pair_sums[i].pushed[c], 0) : atomicExchange(pair_sums[i].turned[c], 0);
  return in_metres(sum.x, sum.y, sum.z);
}
void note_truncated(float mass, vec3 velocity) {
  atomicAdd(totals.truncated, 1u);
  atomicAdd(totals.taken, uint(min(length(velocity) * mass / (TOTAL_MASS * TAKEN_UNIT), 1e9)));
}
void move(uint i) {
  vec3 stopped = taken(i, 0), pushed = taken(i, 1), turned = taken(i, 2);
  float part = uintBitsToFloat(atomicExchange(pair_sums[i].part, floatBitsToUint(1.0)));
  atomicExchange(pair_sums[i].asked[side], 0u);
  atomicExchange(pair_sums[i].left, pair_sums[i].pairs);
  if (hard_body_of(i) != NONE) return;  // carry.comp moves it
  Position own = positions[i];
  Velocity speed = velocities[i];
  bool is_free = own.inverse_mass > 0.0;
  if (!is_free && speed.high == vec3(0.0)) return;  // not even led
  DoubleSingle x = DoubleSingle(own.high, own.low), v = DoubleSingle(speed.high, speed.low);
  vec3 moved = stopped + pushed, way = way_of(i) + moved;
  vec4 listed = texelFetch(listed_places, int(i));
  vec3 before = (x.high - listed.xyz) - way_of(i);
  float limit = uintBitsToFloat(floatBitsToUint(listed.w) & ~PAIRED);
  if (length(before + part * way) > limit) part *= clamp((limit - length(before)) / (part * length(way)), 0.0, 1.0);
  v = add_double(v, (stopped + turned) * params.inverse_h);
  x = add_double(x, moved + (part - 1.0) * way);
  if (part < 1.0) {
    note_truncated(is_free ? 1.0 / own.inverse_mass : 0.0, (1.0 - part) * v.high);
    v = DoubleSingle(part * v.high, part * v.low);
  }
  write_moved(i, own, x, v, speed.work);
}
void act(uint p) {
  SurfacePair pair = pairs[p];
  if (IMPLICIT == 0 && pair.push > 0.0 && is_soft(pair)) turn(pair);  // an implicit step has done what it does
  limit_ways(pair);
  memoryBarrierBuffer();
  uint left[4];
  for (int k = 0; k < 4; ++k) left[k] = atomicAdd(pair_sums[pair.vertices[k]].left, 0xffffffffu);
  for (int k = 0; k < 4; ++k)
    if (left[k] == 1u) moving[atomicAdd(moving_count, 1u)] = pair.vertices[k];
}
void main() {
  if (lane() == 0u) moving_count = 0u;
  barrier();
  uint p = group_index() * PAIR_GROUP + lane();
  if (p < min(counts.pairs, uint(pairs.length()))) act(p);
  memoryBarrierBuffer();
  barrier();
  for (uint j = lane(); j < moving_count; j += PAIR_GROUP) move(moving[j]);
}
