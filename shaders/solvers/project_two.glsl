// As project.glsl, of a kind of two components, which only a material has: they are solved together (method.md eq. 32).
// b of method.md eq. 39b, times h^2.
float stiffness_of_$KIND(Constraint4x2 c, float w[4], float a[2]) {
  float b = 0.0;
  for (int j = 0; j < 4; ++j)
    b += w[j] * (dot(c.gradient[0][j], c.gradient[0][j]) / a[0] + dot(c.gradient[1][j], c.gradient[1][j]) / a[1]);
  return b;
}
void project_$KIND(uint number, uint owned) {
  uint ids = patch_words[RECORDS_AT + number].x;  // its vertices, a byte each
  vec3 x[4];
  float w[4], rest[$VALUES];
  ivec4 first = local_positions[ids & 255u];
  for (int j = 0; j < 4; ++j) {
    ivec4 q = local_positions[local_id(ids, j)];
    x[j] = between(q, first);
    w[j] = inverse_mass_of(q);
  }
  for (uint v = 0u; v < $VALUES; ++v) rest[v] = record_value(number, 1u + v);
  Constraint4x2 c = $KIND(x, rest, ids);
  float a[2], before[2];
  for (uint k = 0u; k < 2u; ++k) {
    a[k] = record_value(number, 1u + $VALUES + k) * params.inverse_h * params.inverse_h;
    before[k] = last_multiplier(number + k);  // a record has several words, the first is theirs
    c.C[k] += a[k] * before[k];
  }
  Multiplier2 m = multiplier(c, w, params.max_correction, a, params.share);
  for (uint k = 0u; k < 2u; ++k) keep_multiplier(number + k, before[k] + m.lambda[k]);
  NOTE_STIFFNESS(stiffness_of_$KIND(c, w, a));
#if COUNT_GUARDS
  if (local_id(ids, 0) < owned) count_guards(m.guards);  // in one patch of those that have it
#endif
  for (int j = 0; j < 4; ++j) {
    uint local = local_id(ids, j);
    if (local >= owned) continue;
    vec3 move = w[j] * (m.lambda[0] * c.gradient[0][j] + m.lambda[1] * c.gradient[1][j]);
    ivec3 quanta = ivec3(round(move * quanta_per_metre[local]));
    for (uint axis = 0u; axis < 3u; ++axis) atomicAdd(sums[3u * local + axis], quanta[axis]);
  }
}
