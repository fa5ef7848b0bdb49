// The rigid motion that takes back the momentum that a few iterations give a free body which touches nothing (method.md
// eq. 43). PARTS work-groups per body, of which the last one to end adds up what all of them found, in order.
#define SUMS_ARE coherent
#define COLUMNS MOMENTUM_COLUMNS
#include "solvers/newton/newton.glsl"
#include "solvers/newton/advance.glsl"
shared bool last;

void write_motion(uint body, DoubleSingle origin) {
  float mass = columns[0][0].w;
  vec3 displacement = columns[0][0].xyz / mass, centre = columns[2][0].xyz / mass,
       d = columns[3][0].xyz - mass * centre * centre, o = columns[4][0].xyz - mass * centre * centre.yzx,
       moment = columns[1][0].xyz - cross(centre, columns[0][0].xyz);
  float trace = (d.x + d.y + d.z) * 1.00001;  // a body in one point has no inverse
  mat3 inertia = mat3(trace - d.x, -o.x, -o.z, -o.x, trace - d.y, -o.y, -o.z, -o.y, trace - d.z);
  vec3 w = inverse(inertia) * moment;
  float angle = length(w), most = 0.5;
  bool good = columns[1][0].w == 0.0 && angle < most;
  DoubleSingle middle = add_double(origin, centre);
  vec4 turn = vec4(good && angle > 0.0 ? w * (sin(0.5 * angle) / angle) : vec3(0.0), good ? cos(0.5 * angle) : 1.0);
  motions[body] = BodyMotion(turn, good ? displacement : vec3(0.0), 0.0, middle.high, 0.0, middle.low, 0.0);
}

void main() {
  uint lane = gl_LocalInvocationIndex, body = group_index() / PARTS, part = group_index() % PARTS;
  if (body >= FREE_BODIES) return;
  uint first = free_bodies[body].first, end = free_bodies[body].end, slice = (end - first + PARTS - 1u) / PARTS;
  DoubleSingle origin = position(first);
  Lengths l = lengths(phases);
  for (int c = 0; c < COLUMNS; ++c) columns[c][lane] = vec4(0.0);
  for (uint i = first + part * slice + lane; i < min(first + (part + 1u) * slice, end); i += GROUP_SIZE) {
    DoubleSingle x = position(i);
    vec4 aim = at(AIM, i);
    vec3 free = start_displacement(i, x) + advanced(i, l).step, u = kept_out(x, free), arm = relative(x, origin) + u,
         f = aim.w * (aim.xyz - u);
    bool held = !(aim.w > 0.0) || u != free || held_by(at(RESIDUAL, i)) != 0u ||
                (floatBitsToUint(at(DISPLACEMENT, i).w) & ~KNOWN) != 0u;
    columns[0][lane] += vec4(f, aim.w);
    columns[1][lane] += vec4(cross(arm, f), held ? 1.0 : 0.0);
    columns[2][lane].xyz += aim.w * arm;
    columns[3][lane].xyz += aim.w * arm * arm;
    columns[4][lane].xyz += aim.w * arm * arm.yzx;
  }
  add_up_columns();
  if (PARTS > 1u) {
    if (lane == 0u) {
      for (uint c = 0u; c < COLUMNS; ++c) momentum_sums[group_index()].columns[c] = columns[c][0];
      memoryBarrierBuffer();
      last = atomicAdd(parts_done[body], 1u) + 1u == PARTS;
    }
    barrier();
    if (!last) return;
    memoryBarrierBuffer();
    for (uint c = 0u; c < COLUMNS; ++c)
      columns[c][lane] = lane < PARTS ? momentum_sums[body * PARTS + lane].columns[c] : vec4(0.0);
    add_up_columns();
  }
  if (lane == 0u) {
    write_motion(body, origin);
    parts_done[body] = 0u;
  }
}
