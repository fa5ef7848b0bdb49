// One constraint of a patch: evaluates it and adds its corrections to the sums of its summed vertices.
void project_$KIND(uvec2 record, uint summed) {
  vec3 x[$ARITY];
  float w[$ARITY];
  ivec4 first = here[record.x & 255u];
  for (int j = 0; j < $ARITY; ++j) {
    ivec4 place = here[slot_of(record.x, j)];
    x[j] = between(place, first);
    w[j] = inverse_mass_of(place);
  }
  Constraint$ARITY c = $KIND(x, uintBitsToFloat(record.y), record.x);
  float stiffness = params.stiffness[$KIND_ROW][$KIND_COLUMN];
#ifdef COMPLIANT
  float a = params.softness[$KIND_ROW][$KIND_COLUMN], gamma = params.relaxation.x, omega = params.relaxation.y, before = 0.0;
  if ((turn.x & PHASE_FIRST) == 0u) before = multipliers[at_record];
#if $GROUPED
  // No further than the full correction where no other constraint of the group is on any of its vertices.
  float most = 0.0;
  for (int j = 0; j < $ARITY; ++j) most = max(most, counts[slot_of(record.x, j)]);
  omega = min(omega, most);
#endif
#ifdef DAMPED
  vec3 start[$ARITY];
  ivec4 first_start = starts[record.x & 255u];
  for (int j = 0; j < $ARITY; ++j) start[j] = between(starts[slot_of(record.x, j)], first_start);
  c.C += gamma * (c.C - $KIND(start, uintBitsToFloat(record.y), record.x).C);
#endif
  c.C += a * before;
  float share = (1.0 + gamma) / omega, lambda = multiplier(c, w, stiffness, params.limit, a, share);
  if (slot_of(record.x, 0) < summed) count_guards(guards_of(c, w, stiffness, params.limit, a, share));
  if ((turn.x & PHASE_LAST) == 0u) multipliers[at_record] = before + lambda;
#else
  float lambda = multiplier(c, w, stiffness, params.limit);
  if (slot_of(record.x, 0) < summed) count_guards(guards_of(c, w, stiffness, params.limit));  // in one patch of those that have it
#endif
  for (int j = 0; j < $ARITY; ++j) {
    uint slot = slot_of(record.x, j);
    if (slot < summed && lambda != 0.0) {
      ivec3 units = ivec3(round(lambda * w[j] * c.gradient[j] * units_per_metre[slot]));
      atomicAdd(sums[3u * slot], units.x);
      atomicAdd(sums[3u * slot + 1u], units.y);
      atomicAdd(sums[3u * slot + 2u], units.z);
    }
  }
}
