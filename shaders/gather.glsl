// Sum of the corrections that every $LANES-th of the constraints of one kind on vertex i, from the lane-th on, asks of it.
layout(std430, binding = $BINDING) readonly buffer Records_$KIND { Record$ARITY records_$KIND[]; };
vec3 gather_$KIND(uint i, uint lane, Position own) {
  uint row = $INDEXu * (params.vertex_count + 1u) + i;
  uint end = adjacency[row + 1u];
  vec3 sum = vec3(0.0);
  for (uint entry = adjacency[row] + lane; entry < end; entry += $LANESu) {
    uint item = adjacency[entry];
    uint slot = item & 3u;
    Record$ARITY record = records_$KIND[item >> 2];
    vec3 x[$ARITY];
    float w[$ARITY];
    Position first = positions[record.vertices[0]];  // relative to the same vertex in every mode: the same bits of C
    for (int j = 0; j < $ARITY; ++j) {
      Position p = positions[record.vertices[j]];
      x[j] = relative(p, first);
      w[j] = p.inverse_mass;
    }
    Constraint$ARITY c = $KIND(x, record.rest, record.vertices);
    vec3 gradient = c.gradient[0];
    for (int j = 1; j < $ARITY; ++j)
      if (slot == uint(j)) gradient = c.gradient[j];
    vec3 correction = params.stiffness[$KIND_ROW][$KIND_COLUMN] * multiplier(c, w) * own.inverse_mass * gradient;
    sum += limited(correction, params.limit);
    count_guards(guards_of(c, w) | guards_of(correction, params.limit));
  }
  return sum;
}
