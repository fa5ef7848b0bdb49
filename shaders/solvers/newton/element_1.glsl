// A constraint with one value: its energy is C^2 / (2 a), and its rate is resisted by tau / a.
void add_$KIND(uint number, uint part, int i, int j, inout mat3 block, inout vec3 force) {
  vec3 x[$ARITY];
  uvec4 ids = uvec4(0u);
  for (uint k = 0u; k < $ARITY; ++k) ids[k] = vertices_$KIND[number][k];
  ivec4 first = start_at(part, ids[0]);
  for (uint k = 0u; k < $ARITY; ++k) x[k] = between(start_at(part, ids[k]), first);
  Constraint$ARITY c = $KIND(x, rest_$KIND(number), ids);
#if $MATERIAL
  float a = compliances_$KIND[number];
#else
  float a = params.compliance[$KIND_ROW][$KIND_COLUMN] * (params.h * params.h);
#endif
  float push = $RATE == 1 ? 0.0 : c.C, held = $RATE == 1 ? 0.0 : 1.0;
#if $OWN
  float tau = $RATE == 1 ? 1.0 : dampings_$KIND[number];
#else
  float tau = $RATE == 1 ? 1.0 : params.damping * params.h;
#endif
  if (tau > 0.0) {
    // Along the way since z.
    float h = at(OFFSET, ids[0]).w, rate = 0.0;
    for (int k = 0; k < $ARITY; ++k) {
      uint v = ids[k];
      Position own = positions[v];
      vec3 moved =
          own.inverse_mass > 0.0 ? start_of(v, DoubleSingle(own.high, own.low)) - at(OFFSET, v).xyz : vec3(0.0);
      rate += dot(c.gradient[k], moved) / h;
    }
    push += tau * rate;
    held += tau / h;
  }
  vec3 gi = gradient_of(c, i), gj = gradient_of(c, j);
  block += outerProduct(gi * (held / a), gj);
#if $CURVED
  block += $KIND_curvature(c, x, i, j) * (1.0 / a);
#endif
  force += (gi - gj) * (push / (a * float($ARITY)));
}
