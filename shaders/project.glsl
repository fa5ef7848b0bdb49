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
  float lambda = multiplier(c, w, stiffness, params.limit);
  if (slot_of(record.x, 0) < summed) count_guards(guards_of(c, w, stiffness, params.limit));  // in one patch of those that have it
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
