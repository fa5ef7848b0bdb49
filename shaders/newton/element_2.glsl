// A constraint with two values, each with an energy.
void add_$KIND(uint record, uint part, int i, int j, inout mat3 block, inout vec3 force) {
  vec3 x[$ARITY];
  ivec4 first = start_at(part, mesh[record]);
  for (uint k = 0u; k < $ARITY; ++k) x[k] = between(start_at(part, mesh[record + k]), first);
  float a[2];
  for (uint k = 0u; k < 2u; ++k) a[k] = uintBitsToFloat(mesh[record + $ARITY + $VALUES + k]);
  EdgePart p = $KIND_part(x, rest_$KIND(record), a, i, j);
  block += p.block;
  force += p.force;
}
