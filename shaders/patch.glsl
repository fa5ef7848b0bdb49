// Every $GROUP-th constraint of one kind of a patch, from `at` on.
void solve_$KIND(uint at, uint end) {
  for (; at < end; at += $GROUPu) {
    uvec2 record = records[at];
    uint slot[$ARITY];
    vec3 x[$ARITY];
    float w[$ARITY];
    uint id[$ARITY];
    for (int j = 0; j < $ARITY; ++j) slot[j] = (record.x >> (8 * j)) & 255u, id[j] = names[slot[j]];
    for (int j = 0; j < $ARITY; ++j) x[j] = between(here[slot[j]], here[slot[0]]), w[j] = inverse_mass_of(here[slot[j]]);
    Constraint$ARITY c = $KIND(x, uintBitsToFloat(record.y), id);
    float lambda = params.stiffness[$KIND_ROW][$KIND_COLUMN] * multiplier(c, w);
    uint guards = guards_of(c, w);
    for (int j = 0; j < $ARITY; ++j) {
      vec3 correction = lambda * w[j] * c.gradient[j];
      guards |= guards_of(correction, params.limit);
      correction = limited(correction, params.limit);
      ivec3 units = ivec3(round(correction * units_per_metre[slot[j]]));
      for (int a = 0; a < 3; ++a)
        if (units[a] != 0) atomicAdd(sums[3u * slot[j] + uint(a)], units[a]);
    }
    count_guards(guards);
  }
}
