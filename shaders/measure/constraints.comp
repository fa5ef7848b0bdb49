// How far edges, hinges and tets of one body are from rest (method.md eqs. 16-19).
#include "measure/reduce.glsl"
#define Ids uint  // no guard asks here
uint id_of(Ids ids, int j) { return 0u; }
#include "constraints/types.glsl"
#include "constraints/bend.glsl"
#include "energy.glsl"
layout(std430) readonly buffer Rest { vec4 rest[]; };
uniform vec4 material;  // energy.glsl
layout(std430) readonly buffer Stretch { Record2 edges[]; };
layout(std430) readonly buffer Bend { Record4 hinges[]; };
layout(std430) readonly buffer Volume { Record4 tets[]; };

void main() {
  uint start = gl_GlobalInvocationID.x;
  uint stride = groups * METRICS_SIZE;
  float squares = 0.0, largest = 0.0;
  for (uint i = edge_range.x + start; i < edge_range.y; i += stride) {
    Record2 r = edges[i];
    float strain = length(relative(positions[r.vertices[1]], positions[r.vertices[0]])) / r.rest - 1.0;
    squares += strain * strain;
    largest = max(largest, abs(strain));
  }
  store_partial(M_STRETCH_SQUARES, squares, false);
  store_partial(M_STRETCH_MAX, largest, true);

  squares = 0.0;
  for (uint i = hinge_range.x + start; i < hinge_range.y; i += stride) {
    Record4 r = hinges[i];
    vec3 x[4];
    for (int j = 0; j < 4; ++j) x[j] = relative(positions[r.vertices[j]], positions[r.vertices[0]]);
    float turn = hinge_angle(x) - r.rest;
    const float pi = 3.14159265358979;
    if (turn > pi) turn -= 2.0 * pi;
    if (turn <= -pi) turn += 2.0 * pi;
    squares += turn * turn;
  }
  store_partial(M_BEND_SQUARES, squares, false);

  float change = 0.0, inverted = 0.0, elastic = 0.0;
  squares = 0.0, largest = 0.0;
  for (uint i = tet_range.x + start; i < tet_range.y; i += stride) {
    Record4 r = tets[i];
    Position p = positions[r.vertices[0]];
    vec3 a = relative(positions[r.vertices[1]], p);
    vec3 b = relative(positions[r.vertices[2]], p);
    vec3 c = relative(positions[r.vertices[3]], p);
    float volume = dot(cross(a, b), c) / 6.0;
    float error = volume - r.rest;
    change += error;
    squares += (error / r.rest) * (error / r.rest);
    largest = max(largest, abs(error / r.rest));
    if (volume <= 0.0) inverted += 1.0;
    if (material.z > 0.0) {
      vec3 now[4] = vec3[](vec3(0.0), a, b, c), at_rest[4];
      for (int j = 0; j < 4; ++j) at_rest[j] = rest[r.vertices[j]].xyz;
      elastic += r.rest * tet_energy(now, at_rest, material);
    }
  }
  store_partial(M_VOLUME_CHANGE, change, false);
  store_partial(M_TET_SQUARES, squares, false);
  store_partial(M_TET_MAX, largest, true);
  store_partial(M_INVERTED, inverted, false);
  store_partial(M_ELASTIC, elastic, false);
}
