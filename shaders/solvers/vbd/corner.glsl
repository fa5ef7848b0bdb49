// Adds what constraint `number` asks of its vertex number i, which is `own`: the gradient of its energy and the
// diagonal block of the Hessian. Damping is that of project.glsl.
void add_$KIND(uint number, int i, Position own, inout mat3 block, inout vec3 gradient) {
  vec3 x[$ARITY];
  uvec4 ids = uvec4(0u);
  for (int k = 0; k < $ARITY; ++k) {
    ids[k] = vertices_$KIND[number][k];
    x[k] = k == i ? vec3(0.0) : relative(positions[ids[k]], own);
  }
#if $COMPONENTS == 2
  float a[2];
  for (uint k = 0u; k < 2u; ++k) a[k] = compliances_$KIND[2u * number + k];
  VertexPart part = $KIND_corner(x, rest_$KIND(number), a, i);
  block += part.block;
  gradient += part.gradient;
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
    vec3 start[$ARITY];
    ivec4 own_start = quantized[params.vertex_count + ids[i]];
    for (int k = 0; k < $ARITY; ++k) start[k] = between(quantized[params.vertex_count + ids[k]], own_start);
    Constraint$ARITY then = $KIND(start, rest_$KIND(number), ids);
    float rise = c.C - then.C;
#if $RATE
    // The change of C, without the cancellation that a difference of two values has.
    rise = 0.0;
    for (int k = 0; k < $ARITY; ++k) rise += 0.5 * dot(c.gradient[k] + then.gradient[k], x[k] - start[k]);
#endif
    push += tau * params.inverse_h * rise;
    held += tau * params.inverse_h;
  }
  vec3 own_gradient = gradient_of(c, i);
  block += outerProduct(own_gradient * (held / a), own_gradient);
#if $CURVED
  for (int j = 0; j < $ARITY; ++j)
    if (j != i) block -= $KIND_curvature(c, x, i, j) * (1.0 / a);
#endif
  gradient += own_gradient * (push / a);
#endif
}
