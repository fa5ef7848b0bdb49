// Moments of one body: mass, momentum, energy, and the covariance that gives its best-fitting rotation.
#include "measure/reduce.glsl"
#include "finite.glsl"
#include "contact/obstacles.glsl"
layout(std430) readonly buffer Velocities { Velocity velocities[]; };
layout(std430) readonly buffer Rest { vec4 rest[]; };

shared uint depths[DEPTHS];

void main() {
  uint me = gl_LocalInvocationIndex;
  if (me < DEPTHS) depths[me] = 0u;
  barrier();
  vec3 moment = vec3(0.0), momentum = vec3(0.0);
  mat3 covariance = mat3(0.0);
  float speed = 0.0, kinetic = 0.0, height = 0.0, contacts = 0.0, work = 0.0, non_finite = 0.0, deepest = 0.0;
  for (uint i = vertex_range.x + gl_GlobalInvocationID.x; i < vertex_range.y; i += groups * METRICS_SIZE) {
    Position p = positions[i];
    vec3 x = relative(p, positions[vertex_range.x]);
    vec3 v = velocities[i].high + velocities[i].low;
    vec4 at_rest = rest[i];
    float m = at_rest.w;
    if (!is_finite(p.high) || !is_finite(v)) non_finite += 1.0;
    moment += m * x;
    momentum += m * v;
    speed += m * length(v);
    kinetic += 0.5 * m * dot(v, v);
    height += m * p.high.y;
    work += velocities[i].work;
    covariance += m * outerProduct(x, at_rest.xyz);
    float least_gap = 0.0;
    for (int k = 0; k < obstacle_count(); ++k) {
      float gap = obstacle_distance(k, DoubleSingle(p.high, p.low));
      if (gap < touching) contacts += 1.0;
      least_gap = min(least_gap, gap);
    }
    deepest = max(deepest, -least_gap);
    int octaves = int(-2.0 * log2(-least_gap * 1e-5 / touching));
    if (least_gap < 0.0 && octaves < DEPTHS) atomicAdd(depths[max(octaves, 0)], 1u);
  }
  for (int a = 0; a < 3; ++a) {
    store_partial(M_MOMENT + a, moment[a]);
    store_partial(M_MOMENTUM + a, momentum[a]);
    for (int b = 0; b < 3; ++b) store_partial(M_COVARIANCE + 3 * a + b, covariance[a][b]);
  }
  store_partial(M_SPEED, speed);
  store_partial(M_KINETIC, kinetic);
  store_partial(M_HEIGHT, height);
  store_partial(M_WORK, work);
  store_partial(M_CONTACTS, contacts);
  store_partial(M_NON_FINITE, non_finite);
  store_partial(M_PENETRATION, deepest);
  if (me < DEPTHS) partials[(M_DEPTHS + me) * METRICS_GROUPS + gl_WorkGroupID.x] = float(depths[me]);
}
