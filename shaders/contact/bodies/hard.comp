// Impulses of the pairs of which a side is a rigid body (sim/contact/hard_pairs.cpp has the same in double). They add
// up over passes, all pairs at once, each on its part of the masses, and begin with those of the substep before. One
// work-group takes all passes, because most scenes have few such pairs.
#include "types.glsl"
#include "double_single.glsl"
layout(local_size_x = HARD_GROUP) in;
#define RIGID_ACCESS coherent
#include "contact/bodies/pairs.glsl"
#define SHARED_TOUCHES
#define TOUCHES Touch contacts[1],
#include "contact/impulses.glsl"
#include "contact/bodies/hard.glsl"
layout(std430) restrict buffer HardPairs {
  uint hard_count;
  uint _0, _1, _2;
  HardPair hard_pairs[];
};
uniform float push_limit;  // offsets in a substep
shared uint change, largest;  // of impulses in a pass, kg m, floats' bits
// How bodies move in this pass, and what pairs add: in shared memory where they find room there.
#if BODY_COUNT <= 256
shared vec3 ways[BODY_COUNT], turns[BODY_COUNT];
shared vec4 masses[3 * BODY_COUNT];  // the inverse inertia, and in the first the inverse mass
shared int changed[6 * BODY_COUNT];
shared uint sharing[2 * BODY_COUNT];
void begin_bodies() {
  for (uint b = lane(); b < uint(BODY_COUNT); b += HARD_GROUP) {
    ways[b] = rigid_bodies[b].hard.way, turns[b] = rigid_bodies[b].hard.turn;
    for (uint k = 0u; k < 3u; ++k) masses[3u * b + k] = rigid_bodies[b].hard.inverse_inertia[k];
    masses[3u * b].w = rigid_bodies[b].hard.inverse_mass;
    for (uint k = 0u; k < 6u; ++k) changed[6u * b + k] = 0;
    sharing[2u * b] = sharing[2u * b + 1u] = 0u;
  }
}
void refresh_bodies(uint next) {
  for (uint b = lane(); b < uint(BODY_COUNT); b += HARD_GROUP) {
    uint k = 6u * b;
    ways[b] = rigid_bodies[b].hard.way + in_metres(changed[k], changed[k + 1u], changed[k + 2u]);
    vec3 turned = in_metres(changed[k + 3u], changed[k + 4u], changed[k + 5u]);
    turns[b] = rigid_bodies[b].hard.turn + turned / params.body_size;
    sharing[2u * b + next] = 0u;
  }
}
void end_bodies() {
  for (uint k = lane(); k < 6u * uint(BODY_COUNT); k += HARD_GROUP)
    rigid_bodies[k / 6u].hard.changed[k % 6u] = changed[k];
}
vec3 way_at(uint b, vec3 arm) { return ways[b] + cross(turns[b], arm); }
float inverse_mass_of(uint b) { return masses[3u * b].w; }
mat3 inverse_inertia_of(uint b) { return mat3(masses[3u * b].xyz, masses[3u * b + 1u].xyz, masses[3u * b + 2u].xyz); }
void add_change(uint b, int k, int quanta) { atomicAdd(changed[6u * b + uint(k)], quanta); }
void note_need(uint b, uint turn) { atomicAdd(sharing[2u * b + turn], 1u); }
uint sharing_of(uint b, uint turn) { return sharing[2u * b + turn]; }
#else
void begin_bodies() {}
void refresh_bodies(uint next) {
  for (uint b = lane(); b < uint(BODY_COUNT); b += HARD_GROUP) {
    rigid_bodies[b].hard.moving = vec4(rigid_bodies[b].hard.way + WAY_IN(rigid_bodies[b].hard.changed), 0.0);
    rigid_bodies[b].hard.turning = vec4(rigid_bodies[b].hard.turn + TURN_IN(rigid_bodies[b].hard.changed), 0.0);
    rigid_bodies[b].hard.sharing[next] = 0u;
  }
}
void end_bodies() {}
vec3 way_at(uint b, vec3 arm) {
  return rigid_bodies[b].hard.moving.xyz + cross(rigid_bodies[b].hard.turning.xyz, arm);
}
float inverse_mass_of(uint b) { return rigid_bodies[b].hard.inverse_mass; }
mat3 inverse_inertia_of(uint b) { return inverse_inertia_of_body(b); }
void add_change(uint b, int k, int quanta) { atomicAdd(rigid_bodies[b].hard.changed[k], quanta); }
void note_need(uint b, uint turn) { atomicAdd(rigid_bodies[b].hard.sharing[turn], 1u); }
uint sharing_of(uint b, uint turn) { return rigid_bodies[b].hard.sharing[turn]; }
#endif

float sign_of(int side) { return side == 0 ? 1.0 : -1.0; }
// Of the first side relative to the second, with all impulses so far.
vec3 way_between(HardPair c) {
  vec3 way = c.soft_way + c.soft_weight * c.impulse;
  for (int side = 0; side < 2; ++side)
    if (c.bodies[side] != NONE) way += sign_of(side) * way_at(c.bodies[side], c.arms[side].xyz);
  return way;
}
// The way per impulse, on one pair's parts of the masses, of which as many share each.
mat3 response_of(HardPair c, uvec2 sharers) {
  mat3 response = mat3(c.soft_weight);
  for (int side = 0; side < 2; ++side) {
    uint b = c.bodies[side];
    if (b == NONE) continue;
    vec3 arm = c.arms[side].xyz;
    mat3 turn = mat3(0.0, arm.z, -arm.y, -arm.z, 0.0, arm.x, arm.y, -arm.x, 0.0);
    response += float(sharers[side]) * (mat3(inverse_mass_of(b)) + transpose(turn) * inverse_inertia_of(b) * turn);
  }
  return response;
}
void find_needs(uint m, int pass) {
  HardPair c = hard_pairs[m];
  float along = dot(way_between(c), c.normal);
  if (pass == 0) {
    float fall = params.h * params.h * length(params.gravity);
    c.least = least_way(along, c.least, fall, c.restitution);
    hard_pairs[m].least = c.least;
  }
  bool needs = c.impulse != vec3(0.0) || (c.acts != 0u && along < c.least);
  hard_pairs[m].needs = needs ? 1u : 0u;
  for (int side = 0; side < 2; ++side)
    if (needs && c.bodies[side] != NONE) note_need(c.bodies[side], uint(pass & 1));
}
// Further in the direction of the last pass (Nesterov), as long as that is downhill (O'Donoghue and Candes 2015).
void add_impulse(uint m, int pass, bool last) {
  HardPair c = hard_pairs[m];
  if (c.needs == 0u) return;
  uvec2 sharers = uvec2(0u);
  for (int side = 0; side < 2; ++side)
    if (c.bodies[side] != NONE) sharers[side] = sharing_of(c.bodies[side], uint(pass & 1));
  mat3 response = response_of(c, sharers);
  Touch touch = Touch(c.normal, vec3(0.0), c.least, c.impulse, response, inverse(response), vec3(0.0), c.friction);
  vec3 now = c.acts != 0u ? impulse_at(touch, way_between(c)) : vec3(0.0);
  bool further = pass > 0 && !last && dot(now - c.impulse, now - c.before) >= 0.0;
  vec3 next = now + (further ? float(pass) / (float(pass) + 3.0) : 0.0) * (now - c.before), more = next - c.impulse;
  atomicMax(change, floatBitsToUint(length(more))), atomicMax(largest, floatBitsToUint(length(next)));
  hard_pairs[m].impulse = next, hard_pairs[m].before = now;
  for (int side = 0; side < 2; ++side) {
    uint b = c.bodies[side];
    if (b == NONE) continue;
    vec3 q = sign_of(side) * more;
    ivec3 moved = to_quanta(inverse_mass_of(b) * q),
          turned = to_quanta(inverse_inertia_of(b) * cross(c.arms[side].xyz, q) * params.body_size);
    for (int k = 0; k < 3; ++k) {
      if (moved[k] != 0) add_change(b, k, moved[k]);
      if (turned[k] != 0) add_change(b, 3 + k, turned[k]);
    }
  }
}
float push_of(HardPair c) {
  Proximity t;
  t.distance = c.distance;
  Meeting meeting;
  uvec2 sharers = uvec2(0u);
  for (int side = 0; side < 2; ++side)
    if (c.bodies[side] != NONE) sharers[side] = rigid_bodies[c.bodies[side]].hard.pairs;
  meeting.weight = dot(c.normal, response_of(c, sharers) * c.normal);
  return c.acts != 0u ? push_apart(t, meeting, c.offset, push_limit) : 0.0;
}
// What the pair does to vertices of soft sides and to places of bodies, and with what impulse it begins the next
// substep: no larger than in this one or the one before, so that a blow does not go on.
void finish(uint m) {
  HardPair c = hard_pairs[m];
  float before = pairs[c.pair].push, size = length(c.impulse);
  vec3 next = size > before ? c.impulse * (before / size) : c.impulse, push = push_of(c) * c.normal;
  for (int k = 0; k < 3; ++k) pairs[c.pair].impulse[k] = next[k];
  pairs[c.pair].push = size;
  for (int side = 0; side < 2; ++side) {
    uint b = c.bodies[side];
    if (b == NONE) continue;
    vec3 arm = c.arms[side].xyz, p = sign_of(side) * push;
    float weight = rigid_bodies[b].hard.inverse_mass;
    ADD_MOTION(rigid_bodies[b].hard.pushed, weight * p, inverse_inertia_of_body(b) * cross(arm, p))
    ADD_MOTION(rigid_bodies[b].hard.next, weight * sign_of(side) * next,
               weight * sign_of(side) * cross(arm, next) / (params.body_size * params.body_size))
  }
  if (c.bodies[0] != NONE && c.bodies[1] != NONE) return;
  SurfacePair pair = pairs[c.pair];
  PairState s = state_of(pair.vertices);
  bool of_edges = (pair.first & OF_EDGES) != 0u;
  Proximity t = proximity_of(s.places, of_edges);
  for (int k = 0; k < 4; ++k) {
    if (c.bodies[k < (of_edges ? 2 : 1) ? 0 : 1] != NONE) continue;
    uint i = pair.vertices[k];
    ivec3 stopped = to_quanta(s.weights[k] * t.weights[k] * c.impulse),
          pushed = to_quanta(s.weights[k] * t.weights[k] * push);
    for (int a = 0; a < 3; ++a) {
      if (stopped[a] != 0) atomicAdd(pair_sums[i].stopped[a], stopped[a]);
      if (pushed[a] != 0) atomicAdd(pair_sums[i].pushed[a], pushed[a]);
    }
  }
}
void wait() {
  memoryBarrierShared();
  memoryBarrierBuffer();
  barrier();
}
// Whether impulses have settled.
bool pass_over(uint count, int pass, bool last) {
  if (lane() == 0u) change = largest = 0u;
  for (uint m = lane(); m < count; m += HARD_GROUP) find_needs(m, pass);
  wait();
  for (uint m = lane(); m < count; m += HARD_GROUP) add_impulse(m, pass, last);
  wait();
  bool settled = uintBitsToFloat(change) <= SETTLED * uintBitsToFloat(largest);
  refresh_bodies(uint(pass & 1));
  wait();
  return settled;
}
void main() {
  uint count = min(hard_count, uint(hard_pairs.length()));
  if (count == 0u) return;
  bool last = false;
  begin_bodies();
  refresh_bodies(0u);
  wait();
  for (int pass = 0; !last; ++pass) {
    last = pass + 1 == MOST_PASSES;
    if (pass_over(count, pass, last) && !last) {  // what is left of a change goes no further
      last = true;
      pass_over(count, pass + 1, last);
    }
  }
  for (uint m = lane(); m < count; m += HARD_GROUP) finish(m);
  end_bodies();
}
