// One body's distance to its rigidly aligned rest shape (method.md eq. 20), and angular momentum about its centre.
#define FIRST M_ANGULAR
#define REDUCED 4
#include "measure/reduce.glsl"

void main() {
  vec3 centre = vec3(row[M_CENTRE], row[M_CENTRE + 1], row[M_CENTRE + 2]);
  vec3 drift = vec3(row[M_MOMENTUM], row[M_MOMENTUM + 1], row[M_MOMENTUM + 2]) / mass;
  float w = row[M_ROTATION];
  vec3 q = vec3(row[M_ROTATION + 1], row[M_ROTATION + 2], row[M_ROTATION + 3]);
  float squares = 0.0;
  vec3 angular = vec3(0.0);
  for (uint i = vertex_range.x + gl_GlobalInvocationID.x; i < vertex_range.y; i += groups * METRICS_SIZE) {
    vec4 at_rest = rest[i];
    vec3 X = at_rest.xyz;
    vec3 r = relative(positions[i], positions[vertex_range.x]) - centre;
    vec3 u = velocities[i].high + velocities[i].low - drift;
    vec3 apart = r - (X + 2.0 * cross(q, cross(q, X) + w * X));
    squares += at_rest.w * dot(apart, apart);
    angular += at_rest.w * cross(r, u);
  }
  for (int a = 0; a < 3; ++a) values[a] = angular[a];
  values[M_RIGID_SQUARES - FIRST] = squares;
  store_partials();
  if (!ends_last()) return;
  int me = int(gl_LocalInvocationIndex);
  if (me < REDUCED) row[FIRST + me] = total(FIRST + me);
}
