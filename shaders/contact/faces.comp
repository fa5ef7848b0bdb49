// Moves faces of bodies out of obstacles that would get in between their vertices (method.md, "Obstacles with a
// shape"), after the solver moved the vertices. One invocation per face; the last that asks for a vertex moves it.
#include "types.glsl"
#include "double_single.glsl"
layout(local_size_x = FACE_GROUP) in;
#define BEFORE_SUBSTEP 0
#include "contact/bodies/way.glsl"
#include "contact/obstacles.glsl"
#include "contact/deepest.glsl"
#include "contact/sums.glsl"
#include "contact/moved.glsl"
#if CONTACTS
#include "contact/bodies/layout.glsl"
#include "contact/bodies/limit.glsl"
layout(std430) restrict buffer PairSumsByVertex { PairSums pair_sums[]; };
// What moves in place alone must not go past other surfaces unseen: where a vertex has pairs they see to it, else it
// stays within its limit.
vec3 seen_by_pairs(uint i, DoubleSingle x, vec3 placed, vec3 sped) {
  if ((phases & PHASE_NEAR) == 0u) return placed;
  vec4 listed = texelFetch(listed_places, int(i));
  if (floatBitsToInt(listed.w) > 0) return within_limit(listed, x, placed);
  ivec3 pushed = to_quanta(placed - sped);
  for (int c = 0; c < 3; ++c) pair_sums[i].pushed[c] += pushed[c];
  return sped;
}
#else
vec3 seen_by_pairs(uint i, DoubleSingle x, vec3 placed, vec3 sped) { return placed; }
#endif
layout(std430) restrict readonly buffer Faces { uvec4 faces[]; };
// By vertex: places and velocities' ways, times weights; the sum of these; an obstacle, from 1; its faces, and of these
// those that have yet to ask.
struct FaceSums {
  int placed[3], sped[3];
  uint weight, solid, faces, left;
};
layout(std430) restrict buffer FaceSumsByVertex { FaceSums face_sums[]; };
#define WEIGHT 1024.0
struct Face {
  uvec4 corners;
  DoubleSingle first;
  vec3 places[3], ways[3];  // places from the first corner
  float weights[3];         // 1/kg
};
Face face_at(uint number) {
  Face f;
  f.corners = faces[number];
  Position first = positions[f.corners[0]];
  f.first = DoubleSingle(first.high, first.low);
  for (int k = 0; k < 3; ++k) {
    Position own = positions[f.corners[k]];
    f.places[k] = relative(own, first), f.ways[k] = way_of(f.corners[k]), f.weights[k] = own.inverse_mass;
  }
  return f;
}
void add(Face f, vec3 at, vec3 placed, vec3 sped, uint solid) {
  float weight = 0.0;
  for (int k = 0; k < 3; ++k) weight += at[k] * at[k] * f.weights[k];
  if (!(weight > 0.0)) return;
  for (int k = 0; k < 3; ++k) {
    uint i = f.corners[k], share = uint(round(at[k] * WEIGHT));
    float part = f.weights[k] * at[k] / weight * (float(share) / WEIGHT);
    if (share == 0u || part == 0.0) continue;
    ivec3 place = to_quanta(part * placed), speed = to_quanta(part * sped);
    for (int c = 0; c < 3; ++c) {
      if (place[c] != 0) atomicAdd(face_sums[i].placed[c], place[c]);
      if (speed[c] != 0) atomicAdd(face_sums[i].sped[c], speed[c]);
    }
    atomicAdd(face_sums[i].weight, share);
    atomicMax(face_sums[i].solid, solid + 1u);
  }
}
void meet(Face f, int k, vec3 centre, float radius) {
  vec3 arm = arm_from_solid(k, f.first);
  Solid s = solid_at(k);
  Surface middle = surface_of(s, into_solid(k, arm + centre));
  float lowest = 0.0;
  for (int j = 0; j < 3; ++j) lowest = min(lowest, dot(middle.normal, into_solid(k, f.places[j] - centre)));
  // A convex solid's distance rises at least as that from its plane does: what rests on one is searched no further.
  if (s.convex != 0 ? middle.distance + lowest > -1e-3 * radius : middle.distance * s.trust > radius) return;
  Deepest d = deepest_point(s, into_solid(k, arm + f.places[0]), into_solid(k, arm + f.places[1]),
                            into_solid(k, arm + f.places[2]));
  float largest = max(d.weights.x, max(d.weights.y, d.weights.z));
  if (!(d.surface.distance < 0.0) || largest > 0.999) return;  // at a corner it is a matter of the vertex
  vec3 n = d.surface.normal.x * solids[k].right + d.surface.normal.y * solids[k].up +
           d.surface.normal.z * solids[k].front;
  vec3 place = vec3(0.0), way = vec3(0.0);
  for (int j = 0; j < 3; ++j) place += d.weights[j] * f.places[j], way += d.weights[j] * f.ways[j];
  way -= params.h * solid_velocity(k, add_double(f.first, place));
  // What was inside before is moved out without becoming faster.
  float friction = solid_friction(k, f.corners[0]), came = max(d.surface.distance, min(0.0, dot(n, way)));
  add(f, d.weights, plane_correction(n, d.surface.distance, way, friction), plane_correction(n, came, way, friction),
      uint(k));
}
vec3 taken(uint i, bool speed, float weight) {
  ivec3 sum;
  for (int c = 0; c < 3; ++c)
    sum[c] = speed ? atomicExchange(face_sums[i].sped[c], 0) : atomicExchange(face_sums[i].placed[c], 0);
  return in_metres(sum.x, sum.y, sum.z) * (WEIGHT / weight);
}
void move(uint i) {
  atomicExchange(face_sums[i].left, face_sums[i].faces);
  float weight = float(atomicExchange(face_sums[i].weight, 0u));
  uint solid = atomicExchange(face_sums[i].solid, 0u);
  if (weight == 0.0) return;
  vec3 placed = taken(i, false, weight), sped = taken(i, true, weight);
  Position own = positions[i];
  Velocity speed = velocities[i];
  placed = seen_by_pairs(i, DoubleSingle(own.high, own.low), placed, sped);
  DoubleSingle x = add_double(DoubleSingle(own.high, own.low), placed);
  DoubleSingle v = add_double(DoubleSingle(speed.high, speed.low), sped * params.inverse_h);
#if MOVING_SOLIDS
  speed.work += dot(sped, solid_velocity(int(solid) - 1, x)) * params.inverse_h / own.inverse_mass;
#endif
#if IMPLICIT
  vectors[OFFSET * VERTICES + i].xyz += placed;
  vectors[DISPLACEMENT * VERTICES + i].xyz += sped;
  vectors[GAIN * VERTICES + i].xyz += sped * params.inverse_h;
#endif
  write_moved(i, own, x, v, speed.work);
}
shared uint moving[3u * FACE_GROUP], moving_count;
void act(uint number) {
  Face f = face_at(number);
  vec3 centre = (f.places[1] + f.places[2]) / 3.0;
  float radius = length(centre);
  for (int k = 1; k < 3; ++k) radius = max(radius, distance(centre, f.places[k]));
  for (uint left = near_solids(add_double(f.first, centre), 0.5 * radius); left != 0u; left &= left - 1u)
    meet(f, findLSB(left), centre, radius);
  memoryBarrierBuffer();
  for (int k = 0; k < 3; ++k)
    if (atomicAdd(face_sums[f.corners[k]].left, 0xffffffffu) == 1u)
      moving[atomicAdd(moving_count, 1u)] = f.corners[k];
}
void main() {
  uint lane = gl_LocalInvocationIndex, number = group_index() * FACE_GROUP + lane;
  if (lane == 0u) moving_count = 0u;
  barrier();
  if (number < uint(faces.length())) act(number);
  memoryBarrierBuffer();
  barrier();
  for (uint j = lane; j < moving_count; j += FACE_GROUP) move(moving[j]);
}
