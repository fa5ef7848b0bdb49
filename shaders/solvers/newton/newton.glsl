// What the kernels of mode newton share (method.md, "Implicit steps"): a step of BDF2 is one Newton step for the
// displacement u of each vertex over it, solved by conjugate gradients with two levels of preconditioner: 3x3 blocks of
// vertices, and rigid motions of aggregates.
#include "types.glsl"
#include "double_single.glsl"
#include "quantize.glsl"
#include "vertex_state.glsl"
#include "contact/obstacles.glsl"
layout(local_size_x = GROUP_SIZE) in;

#include "solvers/newton/layout.glsl"
layout(std430) restrict buffer Vectors { vec4 vectors[]; };  // by slot, then vertex
vec4 at(uint slot, uint i) { return vectors[slot * VERTICES + i]; }
void put(uint slot, uint i, vec3 v, float w) { vectors[slot * VERTICES + i] = vec4(v, w); }
// Newton's start is a part of the way to `aim`; places after each of four parts, quantized, lie where r, z, p and q
// come later.
const float start_parts[4] = float[4](1.0, 0.5, 0.25, 0.0);
ivec4 start_at(uint part, uint i) { return floatBitsToInt(at(RESIDUAL + part, i)); }

#ifndef BLOCKS_ARE
#define BLOCKS_ARE readonly
#endif
layout(std430) restrict BLOCKS_ARE buffer Blocks { EdgeBlock blocks[]; };

// Of several arrays in a block all but the last need a size, which is not 0. Long ones are of numbers or vectors, for
// Mesa's linker goes through a sized array of structs or arrays element by element. Those that begin with `first_` have
// an end as well.
layout(std430) restrict readonly buffer Mesh {
  uint first_use[EDGES + 1u];  // by edge
  uint uses[max(USES, 1u)];    // PACKED_USE
  uint first_neighbour[VERTICES + 1u];
  uvec2 neighbours[max(2u * EDGES, 1u)];  // edge * 2, and 1 where the row's vertex is its second; vertex
  uvec4 shares[VERTICES];                 // PACKED_SHARE
  uint first_member[AGGREGATES + 1u];
  uvec2 members[max(MEMBERS, 1u)];  // vertex; weight in WEIGHT_UNITs
  FreeBody free_bodies[max(FREE_BODIES, 1u)];
  // Of constraints: vertices, values at rest, compliances of a material, damping of a body's own.
  #foreach uvec$ARITY vertices_$KIND[max(COUNT_$KIND, 1u)];
  #foreach float values_$KIND[max($VALUESu * COUNT_$KIND, 1u)];
  #foreach float compliances_$KIND[max($MATERIALu * $COMPONENTSu * COUNT_$KIND, 1u)];
  #foreach float dampings_$KIND[max($OWNu * COUNT_$KIND, 1u)];
};

#define UNKNOWNS (6u * AGGREGATES)
layout(std430) restrict readonly buffer Coarse {
  vec4 centres[max(AGGREGATES, 1u)];  // of mass at rest; reach
  vec4 coarse_inverse[];              // of the coarse matrix: rows of COARSE_ROW, filled up with zeros
};

#ifndef SUMS_ARE
#define SUMS_ARE
#endif
layout(std430) restrict SUMS_ARE buffer Sums {
  vec4 rotations[max(AGGREGATES, 1u)];  // quaternions
  BodyMotion motions[max(FREE_BODIES, 1u)];
  MomentumSums momentum_sums[max(FREE_BODIES * PARTS, 1u)];
  vec2 group_dots[PRODUCT_GROUPS];  // r . z and z . A z, by work-group of product.comp
  vec2 dots;                        // their sums
  Iteration iterations[2];          // this and the last one, in turn
  float coarse_r[max(4u * COARSE_ROW, 1u)], coarse_q[max(UNKNOWNS, 1u)], coarse_y[max(UNKNOWNS, 1u)];
  float is_free[max(AGGREGATES, 1u)];  // 1: no obstacle holds the aggregate, else 0
  float first_rz;                      // r . z of the first iteration that was healthy
  uint bad_starts[3];                  // how many tets each part of the way turns over or blows up
  uint products_done, parts_done[max(FREE_BODIES, 1u)];  // work-groups that have added their sums
};

// The largest part that a hundredth of all tets at most bears badly: contact crushes a few at any start, and they
// recover.
uint start_part() {
  for (uint part = 0u; part < 3u; ++part)
    if (100u * bad_starts[part] <= TETS) return part;
  return 3u;
}
vec3 turned(vec4 q, vec3 v) { return v + 2.0 * cross(q.xyz, cross(q.xyz, v) + q.w * v); }
vec4 opposite(vec4 q) { return vec4(-q.xyz, q.w); }

// u, moved out of the obstacles that x + u is in.
vec3 kept_out(DoubleSingle x, vec3 u) {
  for (int k = 0; k < obstacle_count(); ++k) {
    Surface plane = surface_ahead(k, x, u, u);
    u -= plane.normal * min(plane.distance, 0.0);
  }
  return u;
}
vec3 aimed(uint i) { return start_parts[start_part()] * at(AIM, i).xyz; }
vec3 start_of(uint i, DoubleSingle x) { return kept_out(x, aimed(i)); }
// In a step an obstacle holds vertex i at the plane that it meets on its way to the start.
vec3 normal_of(int k, uint i) {
  vec3 aim = aimed(i);
  return surface_ahead(k, DoubleSingle(positions[i].high, positions[i].low), aim, aim).normal;
}
// Without what the obstacles of `bits` hold of vertex i: their normals, made orthogonal to each other.
vec3 free_part(vec3 v, uint bits, uint i) {
  if ((bits & (bits - 1u)) == 0u) {
    if (bits != 0u) {
      vec3 n = normal_of(findLSB(bits), i);
      v -= n * dot(n, v);
    }
    return v;
  }
  vec3 held[3] = vec3[3](vec3(0.0), vec3(0.0), vec3(0.0));
  int count = 0;
  for (; bits != 0u && count < 3; bits &= bits - 1u) {
    vec3 n = normal_of(findLSB(bits), i);
    for (int k = 0; k < count; ++k) n -= held[k] * dot(held[k], n);
    float l = length(n);
    if (l > 1e-3) held[count++] = n / l;
  }
  for (int k = 0; k < count; ++k) v -= held[k] * dot(held[k], v);
  return v;
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
// The first iteration of a healthy step has alpha near 1: below LEAST_HEALTH the second level knows nothing of this
// body, and is left out of the rest of the step.
Lengths lengths(uint iteration) {
  Iteration before = iterations[(iteration - 1u) & 1u];
  float rz = dots.x, curvature = dots.y;
  Lengths l = Lengths(0.0, 0.0, rz, before.coarse != 0u);
  if (before.rz > 0.0) {
    l.beta = rz / before.rz;
    curvature -= l.beta * rz / before.alpha;
  }
  if (rz > 0.0 && curvature > 0.0) l.alpha = rz / curvature;
  if (l.coarse && iteration == 1u && !(l.alpha >= LEAST_HEALTH)) {
    l.coarse = false;
    l.alpha = 0.0;
  }
  if (!(l.alpha > 0.0)) l.alpha = l.beta = l.rz = 0.0;
  return l;
}
