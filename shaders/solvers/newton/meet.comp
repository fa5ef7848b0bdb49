// Which pairs of surfaces resist in a substep (method.md eq. 61), how stiffly, and what blocks of the matrix have of
// that. One invocation per pair.
#include "types.glsl"
#include "double_single.glsl"
layout(local_size_x = PAIR_GROUP) in;
#include "contact/bodies/pairs.glsl"
#include "contact/bodies/belonging.glsl"
#include "contact/bodies/pair_friction.glsl"
#include "solvers/newton/press.glsl"
#include "solvers/newton/pressed.glsl"
#include "solvers/newton/touches.glsl"
uniform float push_limit;  // offsets in a substep
shared uint touching, nearest;
// The stiffness of a pair, over that with which its vertices resist by themselves.
const float firm = 10.0;
void add_integers(uint slot, uint i, vec3 numbers) {
  for (uint c = 0u; c < 3u; ++c) atomicAdd(words[word_of(slot, i) + c], int(round(clamp(numbers[c], -1e8, 1e8))));
}
void add_blocks(uvec4 vertices, float b[4], vec3 n, float stiffness, float grip, bool is_held) {
  for (int k = 0; k < 4; ++k) {
    uint i = vertices[k];
    float inertia = at(AIM, i).w;
    if (!(inertia > 0.0) || b[k] == 0.0) continue;
    float unit = b[k] * b[k] / (inertia * BLOCK_QUANTUM), normal = (stiffness - grip) * unit;
    vec3 diagonal = normal * n * n + vec3(grip * unit), across = normal * vec3(n.x * n.y, n.x * n.z, n.y * n.z);
    add_integers(BLOCK, i, diagonal), add_integers(BLOCK2, i, across);
    if (is_held) add_integers(HELD, i, diagonal), add_integers(HELD2, i, across);
  }
}
void join(uint a, uint b) {
  if (a == b) return;
  uint of_a = a * TOUCH_WORDS + b / 32u, of_b = b * TOUCH_WORDS + a / 32u;
  if ((touches[of_a] & (1u << (b % 32u))) != 0u) return;
  atomicOr(touches[of_a], 1u << (b % 32u));
  atomicOr(touches[of_b], 1u << (a % 32u));
}
// N/m, of a vertex along n.
float own_stiffness(uint i, vec3 n) {
  vec3 across = at(OWN2, i).xyz;
  return dot(at(OWN, i).xyz, n * n) + 2.0 * (across.x * n.x * n.y + across.y * n.x * n.z + across.z * n.y * n.z);
}
void meet_pair(uint p) {
  SurfacePair pair = pairs[p];
  bool of_edges = (pair.first & OF_EDGES) != 0u;
  PairState s = state_of(pair.vertices);
  Proximity t = proximity_of(s.places, of_edges);
  vec3 way = vec3(0.0);
  bvec2 moves = bvec2(false);
  vec2 pressed_by = vec2(0.0);
  float yielding = 0.0, b[4];
  for (int k = 0; k < 4; ++k) {
    uint i = pair.vertices[k];
    b[k] = t.weights[k];
    way += b[k] * at(AIM, i).xyz;
    int side = k < (of_edges ? 2 : 1) ? 0 : 1;
    pressed_by[side] = max(pressed_by[side], at(OWN2, i).w);
    if (s.weights[k] > 0.0 && b[k] != 0.0) moves[side] = true;
    if (s.weights[k] > 0.0) yielding += b[k] * b[k] / max(at(AIM, i).w, own_stiffness(i, t.normal));
  }
  float along = dot(t.normal, way), depth = pair.offset - t.distance;
  float stiffness = yielding > 0.0 ? firm / yielding : 0.0;
  // What lies deeper than a force has pressed it comes out slowly, because nothing has given it that energy.
  float start = depth;
  if (depth > 0.0) {
    float pressed = pair.push > 0.0 ? pair.push / max(stiffness, 1e-30) : min(pressed_by.x, pressed_by.y);
    start = min(depth, pressed + push_limit * max(0.0, PUSH_TO * pair.offset - t.distance));
  }
  bool acts = stiffness > 0.0 && along < start && belongs(t, of_edges, pair.first & ~OF_EDGES, pair.second);
  Press c;
  c.places[0] = of_edges ? b[1] : -b[1], c.places[1] = of_edges ? -b[3] : -b[2];
  c.stiffness = acts ? stiffness : 0.0, c.start = start, c.grip = 0.0;
  vec3 friction = vec3(0.0);
  if (acts) {
    friction = vec3(pair.impulse[0], pair.impulse[1], pair.impulse[2]);
    friction -= t.normal * dot(t.normal, friction);
    c.grip = stiffness;
    float limit = friction_between(pair.vertices[0], pair.vertices[3]) * pair.push;
    float force = length(friction - c.grip * (way - along * t.normal));
    if (force > limit) friction *= limit / force, c.grip *= limit / force;
    bool both = moves.x && moves.y;
    add_blocks(pair.vertices, b, t.normal, c.stiffness, c.grip, !both);
    if (both) join(floatBitsToUint(at(REST, pair.vertices[0]).w), floatBitsToUint(at(REST, pair.vertices[3]).w));
    atomicAdd(touching, 1u);
    atomicMin(nearest, floatBitsToUint(t.distance / pair.offset));
  }
  presses[p] = c;
  for (int k = 0; k < 3; ++k) pairs[p].impulse[k] = friction[k];
  pairs[p].normal = vec4(t.normal, t.distance);
  if (depth <= 0.0) pairs[p].push = 0.0;
}
void main() {
  if (lane() == 0u) touching = 0u, nearest = floatBitsToUint(1e30);
  barrier();
  uint p = group_index() * PAIR_GROUP + lane();
  if (p < min(counts.pairs, uint(pairs.length()))) meet_pair(p);
  barrier();
  if (lane() == 0u && touching > 0u) atomicAdd(totals.touching, touching), atomicMin(totals.nearest, nearest);
}
