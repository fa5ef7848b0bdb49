// The correction of a contact; needs positions, velocities, formulas.glsl and sums.glsl.
const float push_most = EDGE / 10.0;  // m in a substep, so that bodies deep in each other come apart gently
#define UNSEEN 4                      // assumed number of contacts of a vertex for which none was predicted
#include "contact/friction.glsl"
#if BODY_FRICTION
float friction_between(uvec4 vertices) { return mean_friction(body_friction(vertices[0]), body_friction(vertices[3])); }
#else  // with a mean of equal values the compiler would round what follows differently
float friction_between(uvec4 vertices) { return params.friction; }
#endif
uniform uint side;  // of the contact counts of vertices, the one for this substep
ivec3 to_quanta(vec3 correction) {
  float most = params.body_size / SUM_PARTS;
  return ivec3(round(clamp(correction, -most, most) * (params.inverse_quantum * SUM_PARTS)));
}
// The share of a contact's vertex in the displacement of the item relative to the target in this substep (m), and in
// their inverse mass (1/kg). All contacts of a vertex get the same part of its mass, so that momentum is conserved.
vec4 vertex_share(uint vertex, float weight) {
  int sharing_it = sharing[shared_at(vertex, side)];
  float split = positions[vertex].inverse_mass * float(sharing_it > 0 ? sharing_it : UNSEEN);
  return vec4(weight * params.h * velocities[vertex].high, weight * weight * split);
}
// `sum`: the shares of all vertices.
void correct(uint vertex, float weight, Stop by, vec4 sum) {
  if (weight == 0.0 || !(sum.w > 0.0)) return;
  float factor = weight * positions[vertex].inverse_mass / sum.w;
  ivec3 stopped = to_quanta(factor * by.stopped), pushed = to_quanta(factor * by.pushed);
  for (uint c = 0u; c < 3u; ++c) {
    if (stopped[c] != 0) atomicAdd(contact_sums[vertex].stopped[c], stopped[c]);
    if (pushed[c] != 0) atomicAdd(contact_sums[vertex].pushed[c], pushed[c]);
  }
}
