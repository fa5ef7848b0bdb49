// The errors of edges, hinges and tets of one body relative to rest (method.md eqs. 16-19).
#include "measure/reduce.glsl"
#define Ids uint  // unused: only guards of projections need vertex numbers
uint id_of(Ids ids, int j) { return 0u; }
#include "constraints/types.glsl"
#include "constraints/bend.glsl"
#include "energy.glsl"
layout(std430) readonly buffer Rest { vec4 rest[]; };
uniform vec4 material;  // energy.glsl
layout(std430) readonly buffer Stretch { Record2 edges[]; };
layout(std430) readonly buffer Bend { Record4 hinges[]; };
layout(std430) readonly buffer Volume { Record4 tets[]; };

// Positions relative to the first vertex.
void find_positions(Record4 r, out vec3 x[4]) {
  for (int j = 0; j < 4; ++j) x[j] = relative(positions[r.vertices[j]], positions[r.vertices[0]]);
}

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
  store_partial(M_STRETCH_SQUARES, squares);
  store_partial(M_STRETCH_MAX, largest);

  squares = 0.0;
  for (uint i = hinge_range.x + start; i < hinge_range.y; i += stride) {
    Record4 r = hinges[i];
    vec3 x[4];
    find_positions(r, x);
    float turn = hinge_angle(x) - r.rest;
    const float pi = 3.14159265358979;
    if (turn > pi) turn -= 2.0 * pi;
    if (turn <= -pi) turn += 2.0 * pi;
    squares += turn * turn;
  }
  store_partial(M_BEND_SQUARES, squares);

  float change = 0.0, inverted = 0.0, elastic = 0.0;
  squares = 0.0, largest = 0.0;
  for (uint i = tet_range.x + start; i < tet_range.y; i += stride) {
    Record4 r = tets[i];
    vec3 x[4], at_rest[4];
    find_positions(r, x);
    float volume = dot(cross(x[1], x[2]), x[3]) / 6.0, error = volume - r.rest;
    change += error;
    squares += (error / r.rest) * (error / r.rest);
    largest = max(largest, abs(error / r.rest));
    if (volume <= 0.0) inverted += 1.0;
    if (material.z > 0.0) {
      for (int j = 0; j < 4; ++j) at_rest[j] = rest[r.vertices[j]].xyz;
      elastic += r.rest * tet_energy(x, at_rest, material);
    }
  }
  store_partial(M_VOLUME_CHANGE, change);
  store_partial(M_TET_SQUARES, squares);
  store_partial(M_TET_MAX, largest);
  store_partial(M_INVERTED, inverted);
  store_partial(M_ELASTIC, elastic);
}
