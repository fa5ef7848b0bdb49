// One body's distance to its rigidly aligned rest shape (method.md eq. 68), angular momentum about its centre, and what
// the averages of smoothed tets store.
#define FIRST M_ANGULAR
#define REDUCED 6
#include "measure/reduce.glsl"
#ifdef AVERAGED
#include "energy.glsl"
#include "averages.glsl"
uniform vec4 material;  // energy.glsl
uniform float midway;   // s, the age of the positions that velocities belong to
uint around;
float age;
vec3 ring_side(uint j) {
  return relative(positions[j], positions[around]) - age * (velocities[j].high - velocities[around].high);
}
float averages_store(uint i, float before) {
  around = i, age = before;
  Ring ring = ring_of(i);
  if (!(ring.inverse_volume > 0.0)) return 0.0;
  mat3 F = mat3(0.0);
  float J = 0.0;
  add_averages(ring, 0u, 1u, F, J);
  return averaged_energy(F * ring.inverse_volume, J * ring.inverse_volume, material) / ring.inverse_volume;
}
#endif

void main() {
  vec3 centre = vec3(row[M_CENTRE], row[M_CENTRE + 1], row[M_CENTRE + 2]);
  vec3 drift = vec3(row[M_MOMENTUM], row[M_MOMENTUM + 1], row[M_MOMENTUM + 2]) / mass;
  float w = row[M_ROTATION];
  vec3 q = vec3(row[M_ROTATION + 1], row[M_ROTATION + 2], row[M_ROTATION + 3]);
  float squares = 0.0;
  vec3 angular = vec3(0.0);
  vec2 stored = vec2(0.0);
  for (uint i = vertex_range.x + gl_GlobalInvocationID.x; i < vertex_range.y; i += groups * METRICS_SIZE) {
    vec4 at_rest = rest[i];
    vec3 X = at_rest.xyz;
    vec3 r = relative(positions[i], positions[vertex_range.x]) - centre;
    vec3 u = velocities[i].high + velocities[i].low - drift;
    vec3 apart = r - (X + 2.0 * cross(q, cross(q, X) + w * X));
    squares += at_rest.w * dot(apart, apart);
    angular += at_rest.w * cross(r, u);
#ifdef AVERAGED
    float now = averages_store(i, 0.0);
    stored += vec2(now, midway > 0.0 ? averages_store(i, midway) : now);
#endif
  }
  for (int a = 0; a < 3; ++a) values[a] = angular[a];
  values[M_RIGID_SQUARES - FIRST] = squares;
  values[M_AVERAGED - FIRST] = stored.x, values[M_AVERAGED_MIDWAY - FIRST] = stored.y;
  store_partials();
  if (!ends_last()) return;
  int me = int(gl_LocalInvocationIndex);
  if (me < REDUCED) row[FIRST + me] = total(FIRST + me);
}
