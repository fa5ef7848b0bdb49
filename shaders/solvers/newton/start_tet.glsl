// Counts tet c among its body's bad ones for each of the first three starts that turns it over or blows it up, of a
// kind that has tets.
void check_start_$KIND(uint c) {
#if $TETS
  if (c >= COUNT_$KIND) return;
  uvec$ARITY ids = vertices_$KIND[c];
  begin_body(ids[0]);
  float before = 1.0;
  for (uint k = 0u; k < 4u; ++k) {
    uint start = 3u - k;  // The fraction 0 comes first: it says what the tet is like now.
    vec3 x[$ARITY];
    ivec4 first = start_at(start, ids[0]);
    for (uint j = 0u; j < $ARITY; ++j) x[j] = between(start_at(start, ids[j]), first);
    float now = $KIND_jacobian(x, rest_$KIND(c));
    if (start == 3u) {
      before = now;
      if (!(now > 0.0)) atomicMin(least, 0u);
    } else if (!(now >= 0.3 * min(1.0, max(before, 0.0)) && now <= 2.0 * max(1.0, before))) {
      atomicAdd(bad_starts[start_number(body_of(ids[0]), start)], 1u);
    }
  }
#endif
}
