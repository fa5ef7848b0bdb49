// How each aggregate has turned since it was last looked at (Mueller, Bender, Chentanez and Macklin 2016), and which of
// Newton's starts turn a tet over or blow it up. A work-group per aggregate, then an invocation per constraint.
#define COLUMNS 3
#include "solvers/newton/newton.glsl"
#define Ids uint
uint id_of(Ids ids, int j) { return 0u; }
#include "constraints/types.glsl"
#foreach #include "constraints/$KIND.glsl"
#foreach #include "solvers/newton/rest.glsl"
#foreach #include "solvers/newton/start_tet.glsl"

void turn(uint aggregate) {
  uint lane = gl_LocalInvocationIndex, first = first_member[aggregate], end = first_member[aggregate + 1u];
  vec4 centre = centres[aggregate];
  begin_body(members[first].x);
  ivec4 origin = start_at(3u, members[first].x);
  mat3 A = mat3(0.0);
  float mass = 0.0;
  for (uint k = first + lane; k < end; k += GROUP_SIZE) {
    uint i = members[k].x;
    float m = float(members[k].y) * at(AIM, i).w;
    A += outerProduct(m * between(start_at(3u, i), origin), at(REST, i).xyz - centre.xyz);
    mass += m;
  }
  for (int c = 0; c < 3; ++c) columns[c][lane] = vec4(A[c], mass);
  add_up_columns();
  if (lane != 0u || columns[0][0].w <= 0.0) return;  // Smoothing may leave an aggregate without a member.
  vec4 before = rotations[aggregate], q = before;
  // Where the vertices lie on a line, this keeps the rotation about it as it was.
  float small = 0.02 * columns[0][0].w * centre.w * centre.w;
  for (int c = 0; c < 3; ++c) A[c] = columns[c][0].xyz + turned(q, mat3(small)[c]);
  for (int round = 0; round < 12; ++round) {
    vec3 across = vec3(0.0);
    float along = 0.0;
    for (int c = 0; c < 3; ++c) {
      vec3 axis = turned(q, mat3(1.0)[c]);
      across += cross(axis, A[c]);
      along += dot(axis, A[c]);
    }
    vec3 w = across / (abs(along) + 1e-9 * small);
    float angle = length(w);
    if (!(angle > 1e-5)) break;
    vec3 n = w * (sin(0.5 * angle) / angle);
    float r = cos(0.5 * angle);
    q = normalize(vec4(r * q.xyz + q.w * n + cross(n, q.xyz), r * q.w - dot(n, q.xyz)));
  }
  rotations[aggregate] = q;
  if (is_step_known(members[first].x) && abs(dot(before, q)) < cos(0.5 * params.turn_limit))
    atomicMin(least, floatBitsToUint(HEALTH_TURNING));
}

void main() {
  uint group = group_index(), lane = gl_LocalInvocationIndex;
  if (group < AGGREGATES) {
    turn(group);
    return;
  }
  uint c = (group - AGGREGATES) * GROUP_SIZE + lane;
  #foreach check_start_$KIND(c);
}
