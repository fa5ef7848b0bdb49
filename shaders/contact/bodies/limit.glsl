// Where pairs of surfaces were found last, and how far from there a vertex may be, m; PAIRED: it has pairs.
layout(binding = UNIT_LISTED) uniform samplerBuffer listed_places;
// As much of a way from x as stays within the limit.
vec3 within_limit(vec4 listed, DoubleSingle x, vec3 way) {
  vec3 away = x.high - listed.xyz;
  if (length(away + way) <= listed.w) return way;
  return way * clamp((listed.w - length(away)) / length(way), 0.0, 1.0);
}
