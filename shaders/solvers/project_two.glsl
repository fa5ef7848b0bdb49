// Does what project.glsl does for a kind of two components, which only a material has and which are solved together
// (method.md eq. 23).
void project_$KIND(uint number, uint owned) {
  uint ids = patch_words[RECORDS_AT + number].x;  // its vertices, a byte each
  begin_body(id_of(ids, 0));
  vec3 x[4];
  float w[4], rest[$VALUES];
  Place first = place_of(ids, 0);
  for (int j = 0; j < 4; ++j) {
    Place own = place_of(ids, j);
    x[j] = between(own, first);
    w[j] = inverse_mass_of(own);
  }
  for (uint v = 0u; v < $VALUES; ++v) rest[v] = record_value(number, 1u + v);
  Constraint4x2 c = $KIND(x, rest, ids);
  float a[2], before[2];
  for (uint k = 0u; k < 2u; ++k) a[k] = record_value(number, 1u + $VALUES + k) * params.inverse_h * params.inverse_h;
#if $AVERAGED
  NOTE_STIFFNESS(smoothed_bound(c, x, w, rest, a));
  c.C[1] = smoothed_J(mean_J(ids), c.C[1] + rest[7]) - rest[7];
#endif
  for (uint k = 0u; k < 2u; ++k) {
    before[k] = last_multiplier(number + k);  // there is one for each pair of words, and a record has several
    c.C[k] += a[k] * before[k];
  }
  Multiplier2 m = multiplier(c, w, FINE(params.max_correction), a, params.share);
  for (uint k = 0u; k < 2u; ++k) keep_multiplier(number + k, before[k] + m.lambda[k]);
#if !$AVERAGED
  NOTE_STIFFNESS(stiffness_bound(c, x, w, a));
#endif
  count_guards(ids, owned, m.guards);
  for (int j = 0; j < 4; ++j)
    add_correction(local_id(ids, j), owned, w[j] * (m.lambda[0] * c.gradient[0][j] + m.lambda[1] * c.gradient[1][j]));
}
