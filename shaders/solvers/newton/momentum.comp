// The rigid motion that takes back the momentum that a few iterations leave a free body (method.md eq. 39). Contact
// holds along its normals, and friction resists as in the residual, so that this works on the ground as in flight.
// Before Newton starts (AT_START) it is the motion by which obstacles stop a body, as rigid as its stiffness makes it.
// PARTS work-groups per body, of which the last one to end adds up what all of them found, in order.
#include "solvers/newton/newton.glsl"
#include "solvers/newton/advance.glsl"
shared bool last;
// Of what holds a vertex along a normal, over its inertia: firm, and not so firm that floats lose inertia beside it.
const float firm = 1e4;

// The columns of the inverse of a symmetric 6x6 matrix by Cholesky's method, one by each of six invocations. A
// direction without inertia stays 0.
shared float inverse_matrix[6][6];
void invert(float K[6][6]) {
  uint column = gl_LocalInvocationIndex;
  if (column < 6u) {
    float factor[6][6], y[6];
    for (int j = 0; j < 6; ++j) {
      float pivot = K[j][j];
      for (int k = 0; k < j; ++k) pivot -= factor[j][k] * factor[j][k];
      bool any = pivot > 1e-6 * K[j][j];
      factor[j][j] = any ? inversesqrt(pivot) : 0.0;
      for (int i = j + 1; i < 6; ++i) {
        float sum = K[i][j];
        for (int k = 0; k < j; ++k) sum -= factor[i][k] * factor[j][k];
        factor[i][j] = sum * factor[j][j];
      }
    }
    for (int i = 0; i < 6; ++i) {
      float sum = uint(i) == column ? 1.0 : 0.0;
      for (int k = 0; k < i; ++k) sum -= factor[i][k] * y[k];
      y[i] = sum * factor[i][i];
    }
    for (int i = 5; i >= 0; --i) {
      float sum = y[i];
      for (int k = i + 1; k < 6; ++k) sum -= factor[k][i] * y[k];
      y[i] = sum * factor[i][i];
    }
    for (int i = 0; i < 6; ++i) inverse_matrix[i][column] = y[i];
  }
  barrier();
}
float[6] solved(float b[6]) {
  float q[6];
  for (int i = 0; i < 6; ++i) {
    q[i] = 0.0;
    for (int j = 0; j < 6; ++j) q[i] += inverse_matrix[i][j] * b[j];
  }
  return q;
}

shared float totals[4u * MOMENTUM_COLUMNS];
vec3 total3(uint at) { return vec3(totals[at], totals[at + 1u], totals[at + 2u]); }
BodyMotion motion_of(uint body, DoubleSingle origin) {
  float mass = totals[3u], K[6][6], b[6], reach = sqrt((totals[MATRIX_AT + 15u] + totals[MATRIX_AT + 18u]) / mass);
  // Turns are measured by how far they take vertices, which makes all six unknowns lengths.
  uint at = MATRIX_AT;
  for (int i = 0; i < 6; ++i)
    for (int j = i; j < 6; ++j) K[i][j] = K[j][i] = totals[at++] / (i < 3 ? 1.0 : reach) / (j < 3 ? 1.0 : reach);
  for (int i = 0; i < 6; ++i) b[i] = i < 3 ? totals[uint(i)] : totals[uint(i) + 1u] / reach;
  invert(K);
#if AT_START
  uint row = gl_LocalInvocationIndex;
  if (row < 36u)
    responses[body].inverse[row] =
        inverse_matrix[row / 6u][row % 6u] / (row < 18u ? 1.0 : reach) / (row % 6u < 3u ? 1.0 : reach);
#endif
  float q[6] = solved(b), rest[6];
  for (int i = 0; i < 6; ++i) {  // again for what rounding left
    rest[i] = b[i];
    for (int j = 0; j < 6; ++j) rest[i] -= K[i][j] * q[j];
  }
  float more[6] = solved(rest);
  for (int i = 0; i < 6; ++i) q[i] += more[i];

  vec3 centre = total3(8u) / mass, w = vec3(q[3], q[4], q[5]) / reach, displacement = vec3(q[0], q[1], q[2]);
  displacement += cross(w, centre);
  float angle = length(w), most = 0.5;
  bool good = totals[7u] == 0.0 && angle < most && reach > 0.0;
  DoubleSingle middle = add_double(origin, centre);
  vec4 turn = vec4(good && angle > 0.0 ? w * (sin(0.5 * angle) / angle) : vec3(0.0), good ? cos(0.5 * angle) : 1.0);
#if AT_START
  if (gl_LocalInvocationIndex == 0u) responses[body].arm = vec4(centre, 0.0);
#endif
  vec3 push = total3(PUSH_AT), need = total3(NEED_AT) + mass * displacement;
  // At the start there is no residual to compare with.
  float load = good && dot(push, push) > 0.0 ? clamp(dot(need, push) / dot(push, push), 0.25, 4.0) : 1.0;
  float held = dot(push, push) > 0.0 ? 1.0 : 0.0;
  float is_whole = good && AT_START == 1 && is_stiff(body) ? 1.0 : 0.0;
  displacement = good ? displacement : vec3(0.0);
  return BodyMotion(turn, displacement, load, middle.high, held, middle.low, is_whole);
}

float sums[4 * MOMENTUM_COLUMNS];
// Adds the work-group's sums up into `totals`, half of them at a time, in a fixed order: a few invocations for each,
// because a tree of all would wait at seven barriers. Rows are one longer than memory has banks.
#define AT_A_TIME (2u * MOMENTUM_COLUMNS)
#define TURNS max(GROUP_SIZE / AT_A_TIME, 1u)
shared float cells[AT_A_TIME][GROUP_SIZE + 1u];
void add_up() {
  uint lane = gl_LocalInvocationIndex, row = lane / TURNS;
  for (uint begin = 0u; begin < 4u * MOMENTUM_COLUMNS; begin += AT_A_TIME) {
    for (uint k = 0u; k < AT_A_TIME; ++k) cells[k][lane] = sums[begin + k];
    barrier();
    float part = 0.0;
    for (uint k = lane % TURNS; k < GROUP_SIZE && row < AT_A_TIME; k += TURNS) part += cells[row][k];
    barrier();
    if (row < AT_A_TIME) cells[row][lane % TURNS] = part;
    barrier();
    if (lane < AT_A_TIME) {
      float sum = 0.0;
      for (uint k = 0u; k < TURNS; ++k) sum += cells[lane][k];
      totals[begin + lane] = sum;
    }
    barrier();
  }
}
// The free bodies that a motion is of: one, or in a step's end those of an island.
struct Members {
  uint island;  // NO_ISLAND: `first` alone
  uint first, count;
  bool are_free;  // all that the island has
};
#define NO_ISLAND 0xffffffffu
bool is_member(Members m, uint number) {
  return m.island == NO_ISLAND ? number == m.first : islands[free_bodies[number]] == m.island;
}
Members members_with(uint number) {
  Members m = Members(NO_ISLAND, number, 1u, true);
  if (AT_START == 1 || BODIES == 1u || (phases & TOGETHER) == 0u) return m;
  m = Members(islands[free_bodies[number]], FREE_BODIES, 0u, true);
  uint bodies_of = 0u;
  for (uint b = 0u; b < BODIES; ++b)
    if (islands[b] == m.island) ++bodies_of;
  for (uint n = 0u; n < FREE_BODIES; ++n)
    if (is_member(m, n)) m.first = min(m.first, n), ++m.count;
  m.are_free = m.count == bodies_of;
  return m;
}
// Adds the work-groups' sums up into `totals`, which are read side by side, because each takes long to arrive.
void add_up_parts(Members members) {
  const uint count = 4u * MOMENTUM_COLUMNS, at_once = AT_A_TIME * GROUP_SIZE / count;
  uint lane = gl_LocalInvocationIndex;
  float sum = 0.0;
  for (uint number = members.first; number < FREE_BODIES; ++number) {
    if (!is_member(members, number)) continue;
    for (uint begin = 0u; begin < PARTS; begin += at_once) {
      uint here = min(at_once, PARTS - begin);
      for (uint k = lane; k < here * count; k += GROUP_SIZE) {
        uint part = number * PARTS + begin + k / count;
        cells[k / GROUP_SIZE][k % GROUP_SIZE] = momentum_sums[part].columns[k % count / 4u][k % 4u];
      }
      barrier();
      for (uint p = 0u; p < here && lane < count; ++p) {
        uint k = p * count + lane;
        sum += cells[k / GROUP_SIZE][k % GROUP_SIZE];
      }
      barrier();
    }
  }
  if (lane < count) totals[lane] = sum;
  barrier();
}
void add3(uint at, vec3 value) {
  for (uint c = 0u; c < 3u; ++c) sums[at + c] += value[c];
}
// Adds N^T B N, with N = (1, -[arm]x) for a rigid motion of the body.
void add_block(vec3 arm, mat3 B) {
  vec3 n[6];
  for (int c = 0; c < 3; ++c) {
    n[c] = mat3(1.0)[c];
    n[3 + c] = cross(n[c], arm);
  }
  uint at = MATRIX_AT;
  for (int i = 0; i < 6; ++i) {
    vec3 b = B * n[i];
    for (int j = i; j < 6; ++j) sums[at++] += dot(b, n[j]);
  }
}
// N/m, with which an obstacle holds a stiff body: also where one vertex bears all of it.
float body_stiffness(uint i, uint body) {
  float h = at(OFFSET, i).w;
  return 100.0 * range_of(body).mass / (h * h);
}
// N/m, with which an obstacle resists a vertex: a tenth of a body's mass is about what touches of one that lies flat.
float contact_stiffness(uint i, uint body) {
  if (AT_START == 1 && is_stiff(body)) return body_stiffness(i, body);
  float h = at(OFFSET, i).w, rate = bodies[body].w * h * h;
  return min(firm, 10.0 * rate) * at(AIM, i).w;
}
// N/m, with which an obstacle holds a vertex.
float holding_stiffness(uint i, uint body) {
  return max(firm * at(AIM, i).w, is_stiff(body) ? body_stiffness(i, body) : 0.0);
}
#if AT_START
void add_vertex(uint i, uint body, DoubleSingle origin) {
  DoubleSingle x = position(i);
  vec4 aim = at(AIM, i);
  vec3 u = aim.xyz, arm = relative(x, origin) + u, f = vec3(0.0);
  mat3 B = mat3(aim.w);
  uint touched = touched_before(i);
  float limit = friction_limit(i, touched);
  if (limit > 0.0) {
    // What slipped in the last step goes on so, and what stuck resists.
    float sticks = at(LEFT, i).w > 0.0 ? 0.0 : grip * aim.w;
    f += friction_force(at(LEFT, i).xyz, i, x, u, touched, sticks);
    for (int c = 0; c < 3 && sticks > 0.0; ++c) B[c] += free_part(mat3(sticks)[c], touched, i);
  }
  float stiff = contact_stiffness(i, body);
  for (int k = 0; k < obstacle_count() && aim.w > 0.0; ++k) {
    Surface plane = surface_ahead(k, x, u, u);
    if (plane.distance >= 0.0) continue;
    f -= plane.normal * (stiff * plane.distance);
    touched = 1u;
    B += outerProduct(plane.normal * stiff, plane.normal);
  }
  sums[PUSH_AT] += touched != 0u ? 1.0 : 0.0;
  if (is_stiff(body)) {  // the whole motion, from where the body is
    f += B * u;
    arm -= u;
  }
  add3(0u, f);
  sums[3] += aim.w;
  add3(4u, cross(arm, f));
  sums[7] += aim.w > 0.0 ? 0.0 : 1.0;
  add3(8u, aim.w * arm);
#if TOUCHING
  if (aim.w > 0.0 && ((phases & TOGETHER) != 0u || motions[body].held > 0.0)) B += pressed_block(i, BLOCK, BLOCK2);
#endif
  add_block(arm, B);
}
#else
// Adds what vertex i is short of to be at rest in its step, and how it resists.
void add_vertex(uint i, uint body, DoubleSingle origin) {
  Lengths l = lengths(iteration(), body);
  DoubleSingle x = position(i);
  vec4 aim = at(AIM, i);
  Advanced now = advanced(i, l);
  vec3 u = start_displacement(i, x) + now.step, arm = relative(x, origin) + u, f = aim.w * (aim.xyz - u);
  add3(NEED_AT, -f);
  mat3 B = mat3(aim.w);
#if TOUCHING
  if (aim.w > 0.0) {
    vec3 push = pressed(i);
    mat3 block = pressed_block(i, HELD, HELD2);
    f += push, B += block;
    if (block[0][0] + block[1][1] + block[2][2] > 0.0) add3(PUSH_AT, push);
  }
#endif
  uint holds = held_by(i), touched = floatBitsToUint(at(INVERSE2, i).w);
  float slides = at(INVERSE, i).w;
  if (friction_limit(i, touched) > 0.0) {
    f += friction_force(at(FRICTION, i).xyz, i, x, u, touched, slides);
    for (int c = 0; c < 3; ++c) B[c] += without(free_part(mat3(slides)[c], touched, i), slip_direction(i));
  }
  for (int k = 0; k < obstacle_count() && aim.w > 0.0; ++k) {
    bool held = (holds & (1u << k)) != 0u;
    Surface plane = surface_ahead(k, x, u, u);
    if (held) {  // What the obstacle bears is what the residual leaves along its normal.
      vec3 n = normal_of(k, i);
      f -= n * dot(n, now.residual);
      B += outerProduct(n * holding_stiffness(i, body), n);
      add3(PUSH_AT, n * max(0.0, -dot(n, now.residual)));
    } else if (plane.distance < 0.0 || surface_ahead(k, x, aim.xyz, aim.xyz).distance < 0.0) {
      // Also what the start has moved out: without it the body would go back in.
      float stiff = contact_stiffness(i, body);
      f -= plane.normal * (stiff * plane.distance);
      B += outerProduct(plane.normal * stiff, plane.normal);
    }
  }
  add3(0u, f);
  sums[3] += aim.w;
  add3(4u, cross(arm, f));
  sums[7] += aim.w > 0.0 ? 0.0 : 1.0;
  add3(8u, aim.w * arm);
  add_block(arm, B);
}
#endif

void write_motion(Members members, BodyMotion motion) {
  if (!members.are_free) motion.turn = vec4(0.0, 0.0, 0.0, 1.0), motion.displacement = vec3(0.0), motion.load = 1.0;
  for (uint n = members.first; n < FREE_BODIES; ++n)
    if (is_member(members, n)) motions[free_bodies[n]] = motion;
}
void main() {
  uint lane = gl_LocalInvocationIndex, number = group_index() / PARTS, part = group_index() % PARTS;
  if (number >= FREE_BODIES) return;
  uint body = free_bodies[number];
  Members members = members_with(number);
  uint first = range_of(body).first, end = range_of(body).end, slice = (end - first + PARTS - 1u) / PARTS;
  DoubleSingle origin = position(range_of(free_bodies[members.first]).first);
  for (int k = 0; k < 4 * MOMENTUM_COLUMNS; ++k) sums[k] = 0.0;
  for (uint i = first + part * slice + lane; i < min(first + (part + 1u) * slice, end); i += GROUP_SIZE)
    add_vertex(i, body, origin);
  add_up();
  if (PARTS * members.count > 1u) {
    for (uint k = lane; k < 4u * MOMENTUM_COLUMNS; k += GROUP_SIZE)
      momentum_sums[group_index()].columns[k / 4u][k % 4u] = totals[k];
    memoryBarrierBuffer();
    barrier();
    if (lane == 0u) last = atomicAdd(parts_done[members.first], 1u) + 1u == PARTS * members.count;
    barrier();
    if (!last) return;
    memoryBarrierBuffer();
    add_up_parts(members);
  }
  BodyMotion motion = motion_of(body, origin);
  if (lane != 0u) return;
  if (AT_START == 0 || (phases & TOGETHER) == 0u) write_motion(members, motion);
  parts_done[members.first] = 0u;
}
