// Sum of the corrections that every $LANES-th of the constraints of one kind on a vertex asks of it, from `at` on. An entry: the
// constraint's other vertices in their order and its rest value; this vertex's own place among them in the top two bits.
layout(std430, binding = $BINDING) restrict readonly buffer Stream_$KIND { uvec$ARITY stream_$KIND[]; };
vec3 share_$KIND(uint i, uvec$ARITY entry, ivec4 self) {
  ivec4 p[$ARITY];
  uint id[$ARITY];
  id[0] = i;
  id[1] = entry[0] & 0x3fffffffu;
  for (int j = 2; j < $ARITY; ++j) id[j] = entry[j - 1];
  p[0] = self;
  for (int j = 1; j < $ARITY; ++j) p[j] = places[id[j]];
  uint slot = $FIRST ? 0u : entry[0] >> 30;
  for (int j = 1; j < $ARITY; ++j)
    if (slot >= uint(j)) {
      ivec4 other = p[j];
      p[j] = p[j - 1];
      p[j - 1] = other;
      uint name = id[j];
      id[j] = id[j - 1];
      id[j - 1] = name;
    }
  vec3 x[$ARITY];
  float w[$ARITY];
  for (int j = 0; j < $ARITY; ++j) x[j] = between(p[j], p[0]), w[j] = inverse_mass_of(p[j]);
  Constraint$ARITY c = $KIND(x, uintBitsToFloat(entry[$ARITY - 1]), id);
  vec3 gradient = c.gradient[0];
  for (int j = 1; j < $ARITY; ++j)
    if (slot == uint(j)) gradient = c.gradient[j];
  vec3 correction = params.stiffness[$KIND_ROW][$KIND_COLUMN] * multiplier(c, w) * inverse_mass_of(self) * gradient;
  count_guards(guards_of(c, w) | guards_of(correction, params.limit));
  return limited(correction, params.limit);
}
vec3 gather_$KIND(uint i, uint at, uint end, uvec$ARITY entry, ivec4 self) {
  vec3 sum = vec3(0.0);
  while (at < end) {
    uvec$ARITY now = entry;
    at += $LANESu;
    if (at < end) entry = stream_$KIND[at];
    sum += share_$KIND(i, now, self);
  }
  return sum;
}
