// Which parts of the way turn a tet over or blow it up; and how each aggregate has turned (Mueller, Bender, Chentanez
// and Macklin 2016), from the way it stood last. A work-group per aggregate, then an invocation per constraint.
#include "solvers/newton/newton.glsl"
#define Ids uint
uint id_of(Ids ids, int j) { return 0u; }
#include "constraints/types.glsl"
#foreach #include "constraints/$KIND.glsl"
#foreach #include "solvers/newton/rest.glsl"
shared vec4 columns[3][GROUP_SIZE];
shared uint bad_here[3];

#foreach #include "solvers/newton/start_$TETS.glsl"

void turn(uint aggregate) {
  uint lane = gl_LocalInvocationIndex, first = first_member[aggregate], end = first_member[aggregate + 1u];
  vec4 centre = centres[aggregate];
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
  barrier();
  for (uint half_size = GROUP_SIZE / 2u; half_size > 0u; half_size /= 2u) {
    if (lane < half_size)
      for (int c = 0; c < 3; ++c) columns[c][lane] += columns[c][lane + half_size];
    barrier();
  }
  if (lane != 0u) return;
  vec4 before = rotations[aggregate], q = before;
  float small = 0.02 * columns[0][0].w * centre.w * centre.w;  // where points lie on a line, as it was
  for (int c = 0; c < 3; ++c) {
    vec3 axis = vec3(0.0);
    axis[c] = small;
    A[c] = columns[c][0].xyz + turned(q, axis);
  }
  for (int round = 0; round < 12; ++round) {
    vec3 across = vec3(0.0);
    float along = 0.0;
    for (int c = 0; c < 3; ++c) {
      vec3 axis = vec3(0.0);
      axis[c] = 1.0;
      axis = turned(q, axis);
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
  bool known = (floatBitsToUint(at(WAY, members[first].x).w) & KNOWN) != 0u;
  if (known && abs(dot(before, q)) < cos(0.5 * params.turn_limit)) atomicMin(least, floatBitsToUint(HEALTH_TURNING));
}

void main() {
  uint group = group_index();
  if (group < AGGREGATES) {
    turn(group);
    return;
  }
  uint c = (group - AGGREGATES) * GROUP_SIZE + gl_LocalInvocationIndex, bad = 0u;
  if (gl_LocalInvocationIndex < 3u) bad_here[gl_LocalInvocationIndex] = 0u;
  barrier();
  #foreach start_$KIND(c, bad);
  for (uint part = 0u; part < 3u; ++part)
    if ((bad & (1u << part)) != 0u) atomicAdd(bad_here[part], 1u);
  barrier();
  if (gl_LocalInvocationIndex < 3u && bad_here[gl_LocalInvocationIndex] > 0u)
    atomicAdd(bad_starts[gl_LocalInvocationIndex], bad_here[gl_LocalInvocationIndex]);
}
