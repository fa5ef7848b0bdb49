// Sums over one body's edges, hinges, tets (method.md eqs. 64-67, and elastic energy) and vertices (moments, momentum,
// energy). The last work-group to end adds the groups' sums into the row, with the body's centre and rotation.
#define FIRST 0
#define REDUCED M_DEPTHS
#include "measure/reduce.glsl"
#define Ids uint  // unused: only guards of projections need vertex numbers
uint id_of(Ids ids, int j) { return 0u; }
#include "constraints/types.glsl"
#include "constraints/bend.glsl"
#include "constraints/isobend.glsl"
#include "energy.glsl"
#include "finite.glsl"
#include "contact/obstacles.glsl"
#include "measure/rotation.glsl"
uniform uvec2 edge_range, hinge_range, tet_range;
uniform vec4 material;           // energy.glsl
uniform vec4 energy_per_square;  // J over C^2 of stretch, bend, volume and isobend, where no material has the energy
uniform float midway;            // s, the age of the positions that velocities belong to
uniform float touching;          // m, the distance to an obstacle that counts as contact
layout(std430) readonly buffer Stretch { Record2 edges[]; };
layout(std430) readonly buffer Bend { Record4 hinges[]; };
#if YIELDING
#define TetRecord YieldRecord
#endif
layout(std430) readonly buffer Volume { TetRecord tets[]; };
shared uint depths[DEPTHS];
shared float totals[M_ANGULAR];

// Positions relative to the first vertex, `age` seconds ago.
void find_positions(uint v[4], float age, out vec3 x[4]) {
  vec3 drift = velocities[v[0]].high;
  for (int j = 0; j < 4; ++j)
    x[j] = relative(positions[v[j]], positions[v[0]]) - age * (velocities[v[j]].high - drift);
}
void find_rest(uint v[4], out vec3 x[4]) {
  for (int j = 0; j < 4; ++j) x[j] = rest[v[j]].xyz - rest[v[0]].xyz;
}
#if YIELDING
// Sides of the metric of which m is the inverse, turned somehow.
void find_rest(float m[6], out vec3 x[4]) {
  mat3 g = inverse(mat3(m[0], m[1], m[2], m[1], m[3], m[4], m[2], m[4], m[5]));
  x[0] = vec3(0.0);
  x[1] = vec3(sqrt(g[0][0]), 0.0, 0.0);
  float b = g[0][1] / x[1].x, d = g[0][2] / x[1].x;
  x[2] = vec3(b, sqrt(g[1][1] - b * b), 0.0);
  float e = (g[1][2] - b * d) / x[2].y;
  x[3] = vec3(d, e, sqrt(g[2][2] - d * d - e * e));
}
#endif

float edge_error(Record2 r, float age) {
  return length(relative(positions[r.vertices[1]], positions[r.vertices[0]]) -
                age * (velocities[r.vertices[1]].high - velocities[r.vertices[0]].high)) - r.rest;
}
void add_edge(Record2 r) {
  float error = edge_error(r, 0.0), strain = error / r.rest;
  values[M_STRETCH_SQUARES] += strain * strain;
  values[M_STRETCH_MAX] = max(values[M_STRETCH_MAX], abs(strain));
  if (!(energy_per_square.x > 0.0)) return;
  float before = edge_error(r, midway);
  values[M_ELASTIC] += energy_per_square.x * error * error;
  values[M_ELASTIC_MIDWAY] += energy_per_square.x * before * before;
}

float hinge_error(Record4 r, vec3 x[4]) {
  float turn = hinge_angle(x) - r.rest;
  const float pi = 3.14159265358979;
  if (turn > pi) turn -= 2.0 * pi;
  if (turn <= -pi) turn += 2.0 * pi;
  return turn;
}
float hinge_elastic(Record4 r, vec3 x[4]) {
  float turn = hinge_error(r, x), elastic = energy_per_square.y * turn * turn;
  if (energy_per_square.w > 0.0) {
    vec3 at_rest[4];
    find_rest(r.vertices, at_rest);
    float C = isobend(x, isobend_rest(at_rest, 0u).values, 0u).C;
    elastic += energy_per_square.w * C * C;
  }
  return elastic;
}
void add_hinge(Record4 r) {
  vec3 x[4], before[4];
  find_positions(r.vertices, 0.0, x);
  float turn = hinge_error(r, x);
  values[M_BEND_SQUARES] += turn * turn;
  if (!(energy_per_square.y + energy_per_square.w > 0.0)) return;
  find_positions(r.vertices, midway, before);
  values[M_ELASTIC] += hinge_elastic(r, x);
  values[M_ELASTIC_MIDWAY] += hinge_elastic(r, before);
}

float volume_of(vec3 x[4]) { return dot(cross(x[1], x[2]), x[3]) / 6.0; }
float tet_elastic(TetRecord r, vec3 x[4]) {
  if (material.z > 0.0) {
    vec3 at_rest[4];
#if YIELDING
    find_rest(r.metric, at_rest);
#else
    find_rest(r.vertices, at_rest);
#endif
    vec4 own = r.mu < 0.0 ? material : vec4(r.mu, r.lambda, material.zw);
    return r.filled * tet_energy(x, at_rest, own);
  }
  float error = volume_of(x) - r.rest;
  return energy_per_square.z * error * error;
}
void add_tet(TetRecord r) {
  vec3 x[4], before[4];
  find_positions(r.vertices, 0.0, x);
  float volume = volume_of(x), error = volume - r.rest, change = error / r.rest;
  values[M_VOLUME_CHANGE] += error;
  values[M_TET_SQUARES] += change * change;
  values[M_TET_MAX] = max(values[M_TET_MAX], abs(change));
  if (volume <= 0.0) values[M_INVERTED] += 1.0;
  if (!(material.z + energy_per_square.z > 0.0)) return;
  float elastic = tet_elastic(r, x), elastic_midway = elastic;
  if (midway > 0.0) {
    find_positions(r.vertices, midway, before);
    elastic_midway = tet_elastic(r, before);
  }
  values[M_ELASTIC] += elastic;
  values[M_ELASTIC_MIDWAY] += elastic_midway;
}

void add_depth(Position p) {
  float least_gap = 0.0;
  for (int k = 0; k < obstacle_count(); ++k) {
    float gap = obstacle_distance(k, DoubleSingle(p.high, p.low));
    if (gap < touching) values[M_CONTACTS] += 1.0;
    least_gap = min(least_gap, gap);
  }
  values[M_PENETRATION] = max(values[M_PENETRATION], -least_gap);
  int octaves = int(-2.0 * log2(-least_gap * 1e-5 / touching));
  if (least_gap < 0.0 && octaves < DEPTHS) atomicAdd(depths[max(octaves, 0)], 1u);
}
void add_vertex(uint i) {
  Position p = positions[i];
  vec3 x = relative(p, positions[vertex_range.x]), v = velocities[i].high + velocities[i].low;
  vec4 at_rest = rest[i];
  float m = at_rest.w;
  if (!is_finite(p.high) || !is_finite(v)) values[M_NON_FINITE] += 1.0;
  values[M_SPEED] += m * length(v);
  values[M_KINETIC] += 0.5 * m * dot(v, v);
  values[M_HEIGHT] += m * p.high.y;
  values[M_WORK] += velocities[i].work;
  for (int a = 0; a < 3; ++a) {
    values[M_MOMENT + a] += m * x[a];
    values[M_MOMENTUM + a] += m * v[a];
    for (int b = 0; b < 3; ++b) values[M_COVARIANCE + 3 * a + b] += m * x[b] * at_rest[a];
  }
  add_depth(p);
}

void write_row() {
  int me = int(gl_LocalInvocationIndex);
  if (me < M_ANGULAR) row[me] = totals[me] = total(me);
  barrier();
  if (me != 0) return;
  float covariance[9];
  for (int k = 0; k < 9; ++k) covariance[k] = totals[M_COVARIANCE + k];
  vec4 rotation = best_rotation(covariance);
  vec3 origin = positions[vertex_range.x].high + positions[vertex_range.x].low;
  for (int a = 0; a < 3; ++a) row[M_CENTRE + a] = totals[M_MOMENT + a] / mass, row[M_ORIGIN + a] = origin[a];
  for (int a = 0; a < 4; ++a) row[M_ROTATION + a] = rotation[a];
}

void main() {
  uint me = gl_LocalInvocationIndex, stride = groups * METRICS_SIZE, start = gl_GlobalInvocationID.x;
  if (me < DEPTHS) depths[me] = 0u;
  barrier();
  for (int k = 0; k < REDUCED; ++k) values[k] = 0.0;
  for (uint i = edge_range.x + start; i < edge_range.y; i += stride) add_edge(edges[i]);
  for (uint i = hinge_range.x + start; i < hinge_range.y; i += stride) add_hinge(hinges[i]);
  for (uint i = tet_range.x + start; i < tet_range.y; i += stride) add_tet(tets[i]);
  for (uint i = vertex_range.x + start; i < vertex_range.y; i += stride) add_vertex(i);
  store_partials();
  if (me < DEPTHS) partials[(M_DEPTHS + me) * METRICS_GROUPS + gl_WorkGroupID.x] = float(depths[me]);
  if (ends_last()) write_row();
}
