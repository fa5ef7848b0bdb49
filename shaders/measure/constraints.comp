// The errors of edges, hinges and tets of one body relative to rest (method.md eqs. 16-19), and their elastic energy.
#include "measure/reduce.glsl"
#define Ids uint  // unused: only guards of projections need vertex numbers
uint id_of(Ids ids, int j) { return 0u; }
#include "constraints/types.glsl"
#include "constraints/bend.glsl"
#include "energy.glsl"
layout(std430) readonly buffer Velocities { Velocity velocities[]; };
layout(std430) readonly buffer Rest { vec4 rest[]; };
uniform vec4 material;           // energy.glsl
uniform vec3 energy_per_square;  // J over C^2 of stretch, bend and volume, where no material has the energy
uniform float midway;            // s, the age of the positions that velocities belong to
layout(std430) readonly buffer Stretch { Record2 edges[]; };
layout(std430) readonly buffer Bend { Record4 hinges[]; };
layout(std430) readonly buffer Volume { Record4 tets[]; };

// Positions relative to the first vertex, `age` seconds ago.
void find_positions(Record4 r, float age, out vec3 x[4]) {
  vec3 drift = velocities[r.vertices[0]].high;
  for (int j = 0; j < 4; ++j)
    x[j] = relative(positions[r.vertices[j]], positions[r.vertices[0]]) -
           age * (velocities[r.vertices[j]].high - drift);
}
float edge_error(Record2 r, float age) {
  return length(relative(positions[r.vertices[1]], positions[r.vertices[0]]) -
                age * (velocities[r.vertices[1]].high - velocities[r.vertices[0]].high)) - r.rest;
}
float hinge_error(Record4 r, float age) {
  vec3 x[4];
  find_positions(r, age, x);
  float turn = hinge_angle(x) - r.rest;
  const float pi = 3.14159265358979;
  if (turn > pi) turn -= 2.0 * pi;
  if (turn <= -pi) turn += 2.0 * pi;
  return turn;
}
float volume_of(vec3 x[4]) { return dot(cross(x[1], x[2]), x[3]) / 6.0; }
float tet_elastic(Record4 r, vec3 x[4]) {
  if (material.z > 0.0) {
    vec3 at_rest[4];
    for (int j = 0; j < 4; ++j) at_rest[j] = rest[r.vertices[j]].xyz;
    return r.rest * tet_energy(x, at_rest, material);
  }
  float error = volume_of(x) - r.rest;
  return energy_per_square.z * error * error;
}

void main() {
  uint start = gl_GlobalInvocationID.x;
  uint stride = groups * METRICS_SIZE;
  float squares = 0.0, largest = 0.0, elastic = 0.0, elastic_midway = 0.0;
  for (uint i = edge_range.x + start; i < edge_range.y; i += stride) {
    Record2 r = edges[i];
    float error = edge_error(r, 0.0), strain = error / r.rest;
    squares += strain * strain;
    largest = max(largest, abs(strain));
    if (energy_per_square.x > 0.0) {
      float before = edge_error(r, midway);
      elastic += energy_per_square.x * error * error;
      elastic_midway += energy_per_square.x * before * before;
    }
  }
  store_partial(M_STRETCH_SQUARES, squares);
  store_partial(M_STRETCH_MAX, largest);

  squares = 0.0;
  for (uint i = hinge_range.x + start; i < hinge_range.y; i += stride) {
    Record4 r = hinges[i];
    float turn = hinge_error(r, 0.0);
    squares += turn * turn;
    if (energy_per_square.y > 0.0) {
      float before = hinge_error(r, midway);
      elastic += energy_per_square.y * turn * turn;
      elastic_midway += energy_per_square.y * before * before;
    }
  }
  store_partial(M_BEND_SQUARES, squares);

  float change = 0.0, inverted = 0.0;
  squares = 0.0, largest = 0.0;
  for (uint i = tet_range.x + start; i < tet_range.y; i += stride) {
    Record4 r = tets[i];
    vec3 x[4], before[4];
    find_positions(r, 0.0, x);
    float volume = volume_of(x), error = volume - r.rest;
    change += error;
    squares += (error / r.rest) * (error / r.rest);
    largest = max(largest, abs(error / r.rest));
    if (volume <= 0.0) inverted += 1.0;
    if (material.z > 0.0 || energy_per_square.z > 0.0) {
      find_positions(r, midway, before);
      elastic += tet_elastic(r, x);
      elastic_midway += tet_elastic(r, before);
    }
  }
  store_partial(M_VOLUME_CHANGE, change);
  store_partial(M_TET_SQUARES, squares);
  store_partial(M_TET_MAX, largest);
  store_partial(M_INVERTED, inverted);
  store_partial(M_ELASTIC, elastic);
  store_partial(M_ELASTIC_MIDWAY, elastic_midway);
}
