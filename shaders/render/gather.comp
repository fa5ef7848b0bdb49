// Values by vertex: with TETS the mean of tet_value() over its tets, otherwise the mean of L/L0 - 1 over its edges.
// Sums are in fixed order, so that they are the same every time.
#include "layout.glsl"
#include "render/layout.glsl"
#include "render/finite.glsl"
#include "render/gathered.glsl"
layout(std430) writeonly buffer Values { float values[]; };

#ifdef TETS
#include "render/values.glsl"
#include "render/material.glsl"
uniform int kind;
vec4 material;  // of the vertex's body
float error(uint v, uint k) {
  uvec4 at = uvec4(v, items[3u * k], items[3u * k + 1u], items[3u * k + 2u]);
  vec3 p[4], r[4];
  for (int i = 0; i < 4; ++i) {
    p[i] = position(at[i]);
    r[i] = rest[at[i]].xyz;
  }
  return tet_value(kind, p, r, material);
}
// Of smoothed tets by averages around the vertex (method.md, "Smoothed tets"): J - 1, or the energy, with their own.
// Tets count by their whole volume, also where the body does not fill them.
float averaged(uint v) {
  mat3 F = mat3(0.0);
  float volume = 0.0, J = 0.0, own = 0.0;
  for (uint k = offsets[v]; k < offsets[v + 1u]; ++k) {
    mat3 sides, at_rest;
    for (int c = 0; c < 3; ++c) {
      uint j = items[3u * k + uint(c)];
      sides[c] = position(j) - position(v);
      at_rest[c] = rest[j].xyz - rest[v].xyz;
    }
    float part = determinant(at_rest), change = determinant(sides) / part;
    mat3 gradient = sides * inverse(at_rest);
    volume += part, F += part * gradient, J += part * change;
    own += part * own_energy(gradient, change, material);
  }
  if (!(volume > 0.0) || !finite(vec3(own * 1e-25))) return 0.0;
  J /= volume;
  return kind == COLOUR_VOLUME ? J - 1.0 : own / volume + averaged_energy(F / volume, J, material);
}
#else
float error(uint v, uint k) {
  return distance(position(items[k]), position(v)) / distance(rest[items[k]].xyz, rest[v].xyz) - 1.0;
}
#endif

float gathered(uint v) {
#ifdef TETS
  material = body_material(rest[v].w);
  if (material.z == 3.0 && (kind == COLOUR_VOLUME || kind == COLOUR_ENERGY)) return averaged(v);
#endif
  float sum = 0.0;
  uint n = 0u;
  for (uint k = offsets[v]; k < offsets[v + 1u]; ++k) {
    float e = error(v, k);
    if (!finite(vec3(e * 1e-25))) continue;  // energies may be large
    sum += e;
    ++n;
  }
  return n > 0u ? sum / float(n) : 0.0;
}

void main() {
  uint v = gl_WorkGroupID.y * gl_NumWorkGroups.x * 128u + gl_GlobalInvocationID.x;
  if (v < count) values[v] = gathered(v);
}
