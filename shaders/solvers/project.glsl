// One constraint of a chunk: evaluates it and gives its corrections to add_correction(), which adds them to sums of the
// vertices that the patch owns, or moves the vertices at once (method.md eqs. 6, 17-18).
void project_$KIND(uint number, uint owned) {
  uvec2 record = patch_words[RECORDS_AT + number];  // its vertices, a byte each; rest
  begin_body(id_of(record.x, 0));
  vec3 x[$ARITY];
  float w[$ARITY];
  Place first = place_of(record.x, 0);
  for (int j = 0; j < $ARITY; ++j) {
    Place own = place_of(record.x, j);
    x[j] = between(own, first);
    w[j] = inverse_mass_of(own);
  }
#if $VALUES == 1
  float rest = uintBitsToFloat(record.y);
#else
  float rest[$VALUES];
  for (uint v = 0u; v < $VALUES; ++v) rest[v] = record_value(number, 1u + v);
#if $DRIVEN
  rest[$VALUES - 2] -= activation_of(uint(rest[$VALUES - 1]));
#endif
#endif
  Constraint$ARITY c = $KIND(x, rest, record.x);
#if $OWN
  float k = record_value(number, 1u + $VALUES + $COMPONENTS),
        gamma = record_value(number, 2u + $VALUES + $COMPONENTS) * params.inverse_h;
#else
  float k = params.stiffness[$KIND_ROW][$KIND_COLUMN], gamma = params.damping;
#endif
#if COMPLIANT
#if $MATERIAL
  float a = record_value(number, 1u + $VALUES) * ($RATE == 1 ? params.inverse_h : params.inverse_h * params.inverse_h);
#else
  float a = params.compliance[$KIND_ROW][$KIND_COLUMN];
#endif
#if !$RATE
  NOTE_STIFFNESS(stiffness_bound(c, x, w, a));
#endif
  float before = last_multiplier(number), share = ($RATE == 1 ? 1.0 : 1.0 + gamma) * params.share;
  if (gamma > 0.0) {
    vec3 start[$ARITY];
    Place first_start = start_of(record.x, 0);
    for (int j = 0; j < $ARITY; ++j) start[j] = between(start_of(record.x, j), first_start);
    Constraint$ARITY then = $KIND(start, rest, record.x);
#if $RATE
    // The change of C, without the cancellation that a difference of two values has.
    c.C = 0.0;
    for (int j = 0; j < $ARITY; ++j) c.C += 0.5 * dot(c.gradient[j] + then.gradient[j], x[j] - start[j]);
#else
    c.C += gamma * (c.C - then.C);
#endif
  }
  c.C += a * before;
#else
  const float a = 0.0, share = 1.0;
#endif
  Multiplier m = multiplier(c, w, k, FINE(params.max_correction), a, share);
#if COMPLIANT
  keep_multiplier(number, before + m.lambda);
#endif
  count_guards(record.x, owned, m.guards);
  for (int j = 0; j < $ARITY && m.lambda != 0.0; ++j)
    add_correction(local_id(record.x, j), owned, m.lambda * w[j] * c.gradient[j]);
}
