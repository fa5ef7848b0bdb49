// What the kernels of mode newton share (method.md, "Implicit steps"): a step of BDF2 is one Newton step for the
// displacement u of each vertex over it, solved by conjugate gradients with a preconditioner of two levels: 3x3 blocks
// of vertices, and rigid motions of aggregates.
#ifndef AT_START  // momentum.comp before Newton starts
#define AT_START 0
#endif
#include "types.glsl"
#include "double_single.glsl"
#include "quantize.glsl"
#include "vertex_state.glsl"
#include "contact/obstacles.glsl"
#include "pull.glsl"
layout(local_size_x = GROUP_SIZE) in;

#include "solvers/newton/layout.glsl"
uint iteration() { return phases % AGAIN; }
uint round_of_newton() { return (phases / AGAIN) & 1u; }
layout(std430) restrict buffer Vectors { vec4 vectors[]; };  // by slot, then vertex
vec4 at(uint slot, uint i) { return vectors[slot * VERTICES + i]; }
void put(uint slot, uint i, vec3 v, float w) { vectors[slot * VERTICES + i] = vec4(v, w); }
// Newton starts at one of four fractions of the displacement that inertia asks for. The quantized positions there lie
// in the slots that r, z, p and q need only later.
const float start_fractions[4] = float[4](1.0, 0.5, 0.25, 0.0);
ivec4 start_at(uint start, uint i) { return floatBitsToInt(at(RESIDUAL + start, i)); }

#ifndef BLOCKS_ARE
#define BLOCKS_ARE readonly
#endif
layout(std430) restrict BLOCKS_ARE buffer Blocks {
#if AVERAGED
  // What smoothed tets add (method.md, "Smoothed tets"): each average of F and J resists all vertices around it, so
  // that a product takes two passes, stresses.comp and product.comp.
  vec4 averages[3u * VERTICES];  // columns of F at Newton's start; J, shear_hold(), 0
  vec4 stresses[3u * VERTICES];  // of a product: the change of stress; of pressure
  vec4 slopes[2u * EDGES];       // V lambda dJ/dx of an edge's first vertex by its second's position, and reversed
#endif
  EdgeBlock blocks[];
};

// In a block of several arrays all but the last need a size, which may not be 0. Long ones hold numbers or vectors,
// because Mesa's linker goes through a sized array of structs or arrays element by element. An array that begins with
// `first_` has an end as well.
layout(std430) restrict readonly buffer Mesh {
  uint first_use[EDGES + 1u];  // by edge
  uint uses[max(USES, 1u)];    // PACKED_USE
  uint first_neighbour[VERTICES + 1u];
  uvec2 neighbours[max(2u * EDGES, 1u)];  // edge * 2, and 1 where the row's vertex is its second; vertex
  uvec4 shares[VERTICES];                 // PACKED_SHARE
  uint first_member[AGGREGATES + 1u];
  uvec2 members[max(MEMBERS, 1u)];  // vertex; weight in WEIGHT_UNITs
  BodyRange body_ranges[BODIES];
  uint free_bodies[max(FREE_BODIES, 1u)];      // those of which no vertex is fixed
  uint aggregate_bodies[max(AGGREGATES, 1u)];  // the body of each aggregate
  uint group_bodies[PRODUCT_GROUPS];           // and of each work-group of product.comp
  // Each kind of constraint has vertices, rest values, a material's compliances, and a body's own damping.
  #foreach uvec$ARITY vertices_$KIND[max(COUNT_$KIND, 1u)];
  #foreach float values_$KIND[max($VALUESu * COUNT_$KIND, 1u)];
  #foreach float compliances_$KIND[max($MATERIALu * $COMPONENTSu * COUNT_$KIND, 1u)];
  #foreach float dampings_$KIND[max($OWNu * COUNT_$KIND, 1u)];
};

#define UNKNOWNS (6u * AGGREGATES)
layout(std430) restrict readonly buffer Coarse {
  vec4 centres[max(AGGREGATES, 1u)];  // of mass at rest; reach
  vec4 bodies[BODIES];      // of each that is free: centre of mass at rest; 1/s^2, stiffness over mass
  vec4 coarse_inverse[];    // of each body's coarse matrix: rows, filled up with zeros
};

// What is coherent is read by the last work-group to end, once it has counted the others.
layout(std430) restrict buffer Sums {
  vec4 rotations[max(AGGREGATES, 1u)];  // quaternions
  BodyMotion motions[BODIES];
  BodyResponse responses[BODIES];  // 0 of one that is not free
  coherent MomentumSums momentum_sums[max(FREE_BODIES * PARTS, 1u)];
  coherent vec2 group_dots[PRODUCT_GROUPS];  // r . z and z . A z, by work-group of product.comp
  vec2 dots[BODIES];                  // their sums
  Iteration iterations[2u * BODIES];  // of each body this one and the last, by turns
  float coarse_r[UNKNOWNS + 3u], coarse_q[max(UNKNOWNS, 1u)], coarse_y[max(UNKNOWNS, 1u)];
  float is_free[max(AGGREGATES, 1u)];  // 1: no obstacle holds the aggregate, else 0
  float first_rz[BODIES];              // r . z of a step's first iteration that was healthy
  uint islands[BODIES];                //  of bodies that press each other, the first
  uint bad_starts[6u * BODIES];        // by round, how many of a body's tets each start turns over or blows up
  coherent uint products_done[BODIES], parts_done[max(FREE_BODIES, 1u)];  // work-groups that have added their sums
};

// A body, and its range, cost no reading where there is only one.
uint body_of(uint i) { return BODIES == 1u ? 0u : floatBitsToUint(at(REST, i).w); }
BodyRange range_of(uint body) {
  const uint row = (UNKNOWNS + 3u) / 4u;
  BodyRange only = BodyRange(0u, VERTICES, 0u, TETS, 0u, AGGREGATES, 0u, row, body_ranges[0].mass);
  return BODIES == 1u ? only : body_ranges[body];
}
uint start_number(uint body, uint start) { return 3u * (round_of_newton() * BODIES + body) + start; }
// The furthest start that at most a hundredth of a body's tets cannot bear: contact crushes a few tets at any start,
// and they recover.
uint chosen_start(uint body) {
  uint tets = range_of(body).tets;
  for (uint start = 0u; start < 3u; ++start)
    if (100u * bad_starts[start_number(body, start)] <= tets) return start;
  return 3u;
}
vec3 turned(vec4 q, vec3 v) { return v + 2.0 * cross(q.xyz, cross(q.xyz, v) + q.w * v); }
vec4 opposite(vec4 q) { return vec4(-q.xyz, q.w); }
DoubleSingle position(uint i) { return DoubleSingle(positions[i].high, positions[i].low); }
bool is_step_known(uint i) { return (floatBitsToUint(at(DISPLACEMENT, i).w) & KNOWN) != 0u; }

#if TOUCHING
#include "solvers/newton/pressed.glsl"
vec3 pressed(uint i) { return pressed_in(floatBitsToInt(at(PRESS, i)), floatBitsToInt(at(PRESS_LOW, i))); }
vec3 taken_press(uint i) {
  vec3 sum = pressed(i);
  put(PRESS, i, vec3(0.0), 0.0);
  put(PRESS_LOW, i, vec3(0.0), 0.0);
  return sum;
}
// N/m, the pairs' part of A's 3x3 block, or in HELD and HELD2 that of fixed surfaces.
mat3 pressed_block(uint i, uint slot, uint slot2) {
  vec3 d = vec3(floatBitsToInt(at(slot, i).xyz)), a = vec3(floatBitsToInt(at(slot2, i).xyz));
  return mat3(d.x, a.x, a.y, a.x, d.y, a.z, a.y, a.z, d.z) * (at(AIM, i).w * BLOCK_QUANTUM);
}
#endif

// u, moved out of the obstacles that x + u is in.
vec3 kept_out(DoubleSingle x, vec3 u) {
  for (int k = 0; k < obstacle_count(); ++k) {
    Surface plane = surface_ahead(k, x, u, u);
    u -= plane.normal * min(plane.distance, 0.0);
  }
  return u;
}
vec3 aimed(uint i) {
  bool placed = AT_START == 0 && (RIGID_START == 1u || round_of_newton() > 0u);
  return start_fractions[chosen_start(body_of(i))] * at(placed ? START : AIM, i).xyz;
}
// Whether this step takes the vertex as one of a stiff body that something holds (is_held_stiff(), as the step began).
bool began_stiff(uint i) { return RIGID_START == 1u && AT_START == 0 && at(START, i).w > 0.0; }
vec3 start_displacement(uint i, DoubleSingle x) { return kept_out(x, aimed(i)); }
// In a step an obstacle holds vertex i at the plane that it meets on its way to the start.
vec3 normal_of(int k, uint i) {
  vec3 aim = aimed(i);
  return surface_ahead(k, position(i), aim, aim).normal;
}
// What is left of v without the normals of the obstacles in `bits`, which are made orthogonal to each other.
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
// The displacement against which friction works, where vertex i moves by u.
vec3 slid_by(uint i, DoubleSingle x, vec3 u, uint touched) {
  return free_part(u - params.h * obstacle_velocity(findLSB(touched), x), touched, i);
}
// Friction is what the last step left of it, and a resistance to sliding (N/m) of so many times inertia's, up to what
// Coulomb allows. Where it sticks, a part of the force stays for the next step, so that nothing creeps: a spring whose
// damping is near the critical one, whatever the body's size.
const float grip = 10.0, kept_grip = 0.25;
// The direction of the friction on a vertex that slips and whose start is taken for where it will be: friction keeps to
// its limit that way, and resists sliding only across it. 0 of any other vertex.
vec3 slip_direction(uint i) { return vec3(at(DIRECTION, i).w, at(IMAGE, i).w, at(STEP, i).w); }
vec3 without(vec3 v, vec3 direction) { return v - direction * dot(direction, v); }
// N, on vertex i where it moves by u, friction has left so much, and it resists sliding by so much.
vec3 friction_force(vec3 left, uint i, DoubleSingle x, vec3 u, uint touched, float resistance) {
  vec3 force = free_part(left, touched, i);
  vec3 slip = AT_START == 1 ? vec3(0.0) : slip_direction(i);
  return resistance > 0.0 ? force - resistance * without(slid_by(i, x, u, touched), slip) : force;
}
// N, the most that friction does on vertex i, by the last step's push (lagged: Li et al. 2020) and the first obstacle
// that it touches.
float friction_limit(uint i, uint touched) {
  float push = at(GAIN, i).w;
  if (!(push > 0.0) || touched == 0u || !(at(AIM, i).w > 0.0)) return 0.0;
  return obstacle_friction(findLSB(touched), i) * push;
}
// The displacement by which the rigid motion of its body moves a vertex that has moved by u.
vec3 rigid_displacement(uint i, DoubleSingle x, vec3 u) {
  if (FREE_BODIES == 0u) return vec3(0.0);
  BodyMotion m = motions[body_of(i)];  // none, of a body that is not free
  vec3 arm = relative(x, DoubleSingle(m.centre_high, m.centre_low)) + u;
  vec3 q = m.turn.xyz;
  // Not the turned arm less the arm, a difference that would drop digits.
  return m.displacement + 2.0 * cross(q, cross(q, arm) + m.turn.w * arm);
}
bool is_stiff(uint body) { return RIGID_START == 1u && bodies[body].w * params.h * params.h > STIFF_BODY; }
// Whether vertex i is of a stiff body that obstacles push.
bool is_held_stiff(uint i) { return is_stiff(body_of(i)) && motions[body_of(i)].held > 0.0; }
uint touched_before(uint i) { return floatBitsToUint(at(DISPLACEMENT, i).w) & ~KNOWN; }
uint held_by(uint i) { return floatBitsToUint(at(FRICTION, i).w); }

#ifdef COLUMNS
// The sums of `columns` over the work-group, in a fixed order, in columns[...][0].
shared vec4 columns[COLUMNS][GROUP_SIZE];
void add_up_columns() {
  uint lane = gl_LocalInvocationIndex;
  barrier();
  for (uint half_size = GROUP_SIZE / 2u; half_size > 0u; half_size /= 2u) {
    if (lane < half_size)
      for (int c = 0; c < COLUMNS; ++c) columns[c][lane] += columns[c][lane + half_size];
    barrier();
  }
}
#endif

// The step lengths of a body's iteration from its dot products (Chronopoulos and Gear 1989): p = z + beta p,
// s += alpha p.
struct Lengths {
  float alpha, beta;
  float rz;
  bool coarse;  // whether the coarse level takes part
};
// The first iteration of a healthy step has alpha near 1. Below LEAST_HEALTH the coarse level knows nothing of this
// body, and is left out of the rest of the step.
Lengths lengths(uint iteration, uint body) {
  Iteration before = iterations[2u * body + ((iteration - 1u) & 1u)];
  vec2 sums = dots[body];
  if (BODIES > 1u && (phases & TOGETHER) != 0u) {
    sums = vec2(0.0);
    for (uint b = 0u; b < BODIES; ++b)
      if (islands[b] == islands[body]) sums += dots[b];
  }
  float rz = sums.x, curvature = sums.y;
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
