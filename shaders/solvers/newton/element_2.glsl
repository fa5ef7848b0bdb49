// A constraint with two values, each with an energy.
void add_$KIND(uint number, uint part, int i, int j, inout mat3 block, inout vec3 force) {
  vec3 x[$ARITY];
  uvec$ARITY ids = vertices_$KIND[number];
  ivec4 first = start_at(part, ids[0]);
  for (uint k = 0u; k < $ARITY; ++k) x[k] = between(start_at(part, ids[k]), first);
  float a[2];
  for (uint k = 0u; k < 2u; ++k) a[k] = compliances_$KIND[2u * number + k];
  EdgePart p = $KIND_part(x, rest_$KIND(number), a, i, j);
  block += p.block;
  force += p.force;
}
