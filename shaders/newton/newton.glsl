// What the kernels of mode newton share (method.md, "Implicit steps"): a step of BDF2 is one Newton step for the displacement u of each
// vertex over it, solved by conjugate gradients with two levels of preconditioner: 3x3 blocks of vertices, and rigid motions of aggregates.
#include "types.glsl"
#include "pair.glsl"
#include "quantized.glsl"
#include "vertex_state.glsl"
#include "contact.glsl"
#if SHAPES
#include "shape_contact.glsl"
#define OBSTACLES (params.plane_count + SHAPES)
#else
#define OBSTACLES params.plane_count
#endif
layout(local_size_x = GROUP_SIZE) in;

#include "newton/vectors.glsl"
// Newton's start is a part of the way to `aim`; places after each of four parts, quantized, lie where r, z, p and q come later.
const float start_parts[4] = float[4](1.0, 0.5, 0.25, 0.0);
ivec4 start_at(uint part, uint i) { return floatBitsToInt(at(RESIDUAL + part, i)); }

// By edge, 3: columns of the block of its first vertex's row and second one's column; and a component each of the force on the first.
#ifndef BLOCKS_ARE
#define BLOCKS_ARE readonly
#endif
layout(std430, binding = BIND_NEWTON_BLOCKS) restrict BLOCKS_ARE buffer Blocks { vec4 blocks[]; };

// Numbers: the first entry of each edge, entries (constraint << 7 | kind << 4 | i << 2 | j), the first neighbour of each
// vertex, neighbours (edge * 2 + 1 where the vertex is its second, vertex), records of each kind, 4 aggregates of each vertex
// (number << 16 | weight * 65535), the first vertex of each aggregate, its vertices (vertex, weight * 65535).
layout(std430, binding = BIND_NEWTON_MESH) restrict readonly buffer Mesh { uint mesh[]; };

// The inverse of the coarse matrix by rows, then centre and reach of each aggregate.
layout(std430, binding = BIND_NEWTON_COARSE) restrict readonly buffer Coarse { vec4 coarse_words[]; };
#define UNKNOWNS (6 * AGGREGATES)
vec4 centre_of(uint aggregate) { return coarse_words[CENTRES_AT + aggregate]; }

// How many tets each part of the way turns over or blows up; then floats: two dot products of every work-group of the matrix's product, their sums, three
// numbers of this and the last iteration, of coarse unknowns r, q and y, rotations as quaternions, whether an aggregate is free (0 or 1), and
// what follows.
#ifndef SUMS_ARE
#define SUMS_ARE
#endif
layout(std430, binding = BIND_NEWTON_SUMS) restrict SUMS_ARE buffer Sums { uint bad_starts[3], products_done, parts_done[FREE_BODIES + 1u]; float sums[]; };
#define DOTS_AT (2 * PRODUCT_GROUPS)
#define SCALARS_AT (DOTS_AT + 2)
#define COARSE_R (SCALARS_AT + 6)
#define COARSE_Q (COARSE_R + UNKNOWNS)
#define COARSE_Y (COARSE_Q + UNKNOWNS)
#define ROTATIONS_AT (COARSE_Y + UNKNOWNS)
#define FREE_AT (ROTATIONS_AT + 4 * AGGREGATES)
#define FIRST_AT (FREE_AT + AGGREGATES)  // r . z of the first iteration
#define MOTIONS_AT (FIRST_AT + 1u)       // of each free body: way, turn (a quaternion), centre (momentum.comp)
#define MOTION_WORDS 13u
#define PARTS_AT (MOTIONS_AT + MOTION_WORDS * FREE_BODIES)

// The largest part that a hundredth of all tets at most bears badly: contact crushes a few at any start, and they recover.
uint start_part() {
  for (uint part = 0u; part < 3u; ++part)
    if (100u * bad_starts[part] <= TETS) return part;
  return 3u;
}
vec4 rotation_of(uint aggregate) {
  uint k = ROTATIONS_AT + 4 * aggregate;
  return vec4(sums[k], sums[k + 1], sums[k + 2], sums[k + 3]);
}
vec3 turned(vec4 q, vec3 v) { return v + 2.0 * cross(q.xyz, cross(q.xyz, v) + q.w * v); }
vec4 opposite(vec4 q) { return vec4(-q.xyz, q.w); }

// The plane of obstacle k that a vertex at x meets on the way u, and the distance of x + u from it.
Surface plane_of(int k, Pair x, vec3 u) {
#if SHAPES
  if (k >= params.plane_count) {
    int s = k - params.plane_count;
    if (!may_meet(s, x, length(u), 1.0)) return Surface(vec3(0.0), 1e9);
    return met(s, pair_add(x, u), u - params.h * shape_velocity(s, x));
  }
#endif
  return Surface(params.planes[k].xyz, depth_of(x, params.planes[k]) + dot(params.planes[k].xyz, u));
}
// u, moved out of the obstacles that x + u is in.
vec3 kept_out(Pair x, vec3 u) {
  for (int k = 0; k < OBSTACLES; ++k) {
    Surface plane = plane_of(k, x, u);
    u -= plane.normal * min(plane.distance, 0.0);
  }
  return u;
}
vec3 aimed(uint i) { return start_parts[start_part()] * at(AIM, i).xyz; }
vec3 start_of(uint i, Pair x) { return kept_out(x, aimed(i)); }
// In a step a shape holds vertex i at the plane that it meets on its way to the start.
vec3 normal_of(uint k, uint i) {
#if SHAPES
  return plane_of(int(k), Pair(positions[i].high, positions[i].low), aimed(i)).normal;
#else
  return params.planes[k].xyz;
#endif
}
// Without what the obstacles of `bits` hold of vertex i: their normals, made orthogonal to each other.
vec3 free_part(vec3 v, uint bits, uint i) {
  if ((bits & (bits - 1u)) == 0u) {
    if (bits != 0u) {
      vec3 n = normal_of(uint(findLSB(bits)), i);
      v -= n * dot(n, v);
    }
    return v;
  }
  vec3 held[3] = vec3[3](vec3(0.0), vec3(0.0), vec3(0.0));
  int count = 0;
  for (; bits != 0u && count < 3; bits &= bits - 1u) {
    vec3 n = normal_of(uint(findLSB(bits)), i);
    for (int k = 0; k < count; ++k) n -= held[k] * dot(held[k], n);
    float l = length(n);
    if (l > 1e-3) held[count++] = n / l;
  }
  for (int k = 0; k < count; ++k) v -= held[k] * dot(held[k], v);
  return v;
}
// Of the first obstacle of `bits`.
float friction_of(uint bits) {
#if SHAPES
  int k = findLSB(bits) - params.plane_count;
  if (k >= 0) return shapes[k].friction;
#endif
  return params.friction;
}
vec3 velocity_of(uint bits, Pair x) {
#if SHAPES
  int k = findLSB(bits) - params.plane_count;
  if (k >= 0) return shape_velocity(k, x);
#endif
  return vec3(0.0);
}
uint held_by(vec4 residual) { return floatBitsToUint(residual.w); }

// A sum over the work-group, in a fixed order; for all of it.
shared vec2 group_sums[GROUP_SIZE];
vec2 group_sum(vec2 value) {
  uint lane = gl_LocalInvocationIndex;
  group_sums[lane] = value;
  barrier();
  for (uint half_size = GROUP_SIZE / 2u; half_size > 0u; half_size /= 2u) {
    if (lane < half_size) group_sums[lane] += group_sums[lane + half_size];
    barrier();
  }
  vec2 sum = group_sums[0];
  barrier();
  return sum;
}

// The step lengths of an iteration from its dot products (Chronopoulos and Gear 1989): p = z + beta p, s += alpha p.
struct Lengths {
  float alpha, beta;
  float rz;
  bool coarse;  // whether the second level takes part
};
// The first iteration of a healthy step has alpha near 1: below LEAST_HEALTH the second level knows nothing of this body, and is left out
// of the rest of the step.
Lengths lengths(uint iteration) {
  vec2 dots = vec2(sums[DOTS_AT], sums[DOTS_AT + 1u]);
  uint last = SCALARS_AT + 3u * ((iteration - 1u) & 1u);
  float rz_before = sums[last], alpha_before = sums[last + 1u];
  Lengths l = Lengths(0.0, 0.0, dots.x, sums[last + 2u] > 0.0);
  float curvature = dots.y;
  if (rz_before > 0.0) {
    l.beta = dots.x / rz_before;
    curvature -= l.beta * dots.x / alpha_before;
  }
  if (dots.x > 0.0 && curvature > 0.0) l.alpha = dots.x / curvature;
  if (l.coarse && iteration == 1u && !(l.alpha >= LEAST_HEALTH)) {
    l.coarse = false;
    l.alpha = 0.0;
  }
  if (!(l.alpha > 0.0)) l.alpha = l.beta = l.rz = 0.0;
  return l;
}
