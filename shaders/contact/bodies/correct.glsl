// The correction of a contact: needs positions, velocities, pairs/formulas.glsl and pairs/sums.glsl.
const float push_most = EDGE / 10.0;  // m, in a substep: so bodies that are deep in each other leave each other
#define UNSEEN 4                      // contacts that may share a vertex of which none was foreseen
#include "contact/friction.glsl"
#if BODY_FRICTION
float friction_between(uvec4 vertices) { return mean_friction(body_friction(vertices[0]), body_friction(vertices[3])); }
#else  // a mean of equals would let the compiler round what follows otherwise
float friction_between(uvec4 vertices) { return params.friction; }
#endif
uniform uint side;                    // of the numbers of contacts that share a vertex, that of this substep
ivec3 to_quanta(vec3 correction) {
  float most = params.body_size / SUM_PARTS;
  return ivec3(round(clamp(correction, -most, most) * (params.inverse_quantum * SUM_PARTS)));
}
// Of a contact's vertex: what it adds to the way of the item relative to the target in this substep (m), and to their
// inverse mass (1/kg). Masses are split among the contacts of a vertex, the same for all of them, so that momentum is
// kept.
vec4 part_of(uint vertex, float weight) {
  int sharing_it = sharing[shared_at(vertex, side)];
  float split = positions[vertex].inverse_mass * float(sharing_it > 0 ? sharing_it : UNSEEN);
  return vec4(weight * params.h * velocities[vertex].high, weight * weight * split);
}
// `sum`: of all parts.
void correct(uint vertex, float weight, Stop by, vec4 sum) {
  if (weight == 0.0 || !(sum.w > 0.0)) return;
  float factor = weight * positions[vertex].inverse_mass / sum.w;
  ivec3 stopped = to_quanta(factor * by.stopped), pushed = to_quanta(factor * by.pushed);
  for (uint c = 0u; c < 3u; ++c) {
    if (stopped[c] != 0) atomicAdd(contact_sums[vertex].stopped[c], stopped[c]);
    if (pushed[c] != 0) atomicAdd(contact_sums[vertex].pushed[c], pushed[c]);
  }
}
