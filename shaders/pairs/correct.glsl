// The correction of a contact: needs positions, velocities, pairs/formulas.glsl and pairs/sums.glsl.
const float push_most = EDGE / 10.0;  // m, in a substep: so bodies that are deep in each other leave each other
uniform uint side;                    // of the numbers of contacts that share a vertex, that of this substep
void add(uint sum, vec3 correction) {
  ivec3 quanta = ivec3(round(clamp(correction, -params.body_size / PARTS, params.body_size / PARTS) * (params.inverse_quantum * PARTS)));
  for (uint c = 0u; c < 3u; ++c)
    if (quanta[c] != 0) atomicAdd(pair_sums[sum + c], quanta[c]);
}
// m, in this substep, of the item relative to the target.
vec3 way_of(Meeting m, uvec4 vertices) {
  vec3 way = vec3(0.0);
  for (uint j = 0u; j < 4u; ++j) way += m.weights[j] * params.h * velocities[vertices[j]].high;
  return way;
}
// 1/kg, of the item beside the target: masses are split among the contacts of a vertex, the same for all of them, so that momentum is kept.
float split_mass(Meeting m, uvec4 vertices) {
  float sum = 0.0;
  for (uint j = 0u; j < 4u; ++j)
    sum += m.weights[j] * m.weights[j] * positions[vertices[j]].inverse_mass * float(max(pair_sums[sharing(vertices[j], side)], 1));
  return sum;
}
void correct(Meeting m, uvec4 vertices, vec3 way, float split) {
  if (!(split > 0.0)) return;
  Stop by = meeting_correction(m, way, push_most, params.friction);
  for (uint j = 0u; j < 4u; ++j) {
    if (m.weights[j] == 0.0) continue;
    float factor = m.weights[j] * positions[vertices[j]].inverse_mass / split;
    add(sums_of(vertices[j]), factor * by.stopped);
    add(sums_of(vertices[j]) + PUSHED, factor * by.pushed);
  }
}
