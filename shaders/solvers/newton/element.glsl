// Adds what a constraint has of an edge, its vertices number i and j: a block of the matrix and the force on i. The
// energy is C^2 / (2 a); damping resists the rate of C by tau / a. Two components have an energy each. `start` is that
// of an only body.
void add_$KIND(uint number, uint start, int i, int j, inout mat3 block, inout vec3 force) {
  vec3 x[$ARITY];
  uvec4 ids = uvec4(0u);
  for (uint k = 0u; k < $ARITY; ++k) ids[k] = vertices_$KIND[number][k];
  begin_body(ids[0]);
  if (BODIES > 1u) start = chosen_start(body_of(ids[0]));
  ivec4 first = start_at(start, ids[0]);
  for (uint k = 0u; k < $ARITY; ++k) x[k] = between(start_at(start, ids[k]), first);
#if $COMPONENTS == 2
  float a[2];
  for (uint k = 0u; k < 2u; ++k) a[k] = compliances_$KIND[2u * number + k];
#if $AVERAGED
  float mean = 0.0;
  for (int k = 0; k < 4; ++k) mean += 0.25 * averages[3u * ids[k]].w;
  EdgePart part = $KIND_part(x, rest_$KIND(number), a, mean, i, j);
  slope_of_first += smoothed_slope(x, rest_$KIND(number), j) * (0.25 / a[1]);
  slope_of_second += smoothed_slope(x, rest_$KIND(number), i) * (0.25 / a[1]);
#else
  EdgePart part = $KIND_part(x, rest_$KIND(number), a, i, j);
#endif
  block += part.block;
  force += part.force;
#else
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
    // The rate is that of the displacement from BDF2's z to Newton's start.
    float h = at(OFFSET, ids[0]).w, rate = 0.0;
    for (int k = 0; k < $ARITY; ++k) {
      uint v = ids[k];
      Position own = positions[v];
      vec3 moved = vec3(0.0);
      if (own.inverse_mass > 0.0)
        moved = start_displacement(v, DoubleSingle(own.high, own.low)) - at(OFFSET, v).xyz;
      else
        moved = h * velocities[v].high;  // where it is led
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
#endif
}
