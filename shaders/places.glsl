// A place: a position in whole units, modulo 2^32 in each component, with the inverse mass (times n_i for mass splitting) as float bits. Differences of
// places wrap as well, so they are exact wherever the body is, as long as the vertices of a constraint are within 2^31 units
// of each other (method.md, "What neighbours see").
// With constraint damping (DAMPED) as many follow: where the vertices were at the substep's start.
// Read from one buffer and written to another (or the same, where nobody reads in the dispatch that writes).
layout(std430, binding = BIND_PLACES) restrict readonly buffer Places { ivec4 places[]; };
layout(std430, binding = BIND_PLACES_OUT) restrict writeonly buffer PlacesOut { ivec4 places_out[]; };
// PHASE_ bits and group, and where to note what is not finite (first_bad.glsl).
layout(location = 0) uniform uvec2 turn;

// Halves of 16 bits: a float holds neither 2^32 nor a small negative number plus 2^32.
ivec4 place_of(Pair x, float weight) {
  vec3 units = x.high * params.inverse_unit;
  vec3 upper = floor(units / 65536.0);
  vec3 lower = (units - upper * 65536.0) + x.low * params.inverse_unit;
  upper -= floor(upper / 65536.0) * 65536.0;
  uvec3 place = uvec3(upper) * 65536u + uvec3(ivec3(floor(lower + 0.5)));
  return ivec4(ivec3(place), floatBitsToInt(weight));
}
float inverse_mass_of(ivec4 place) { return intBitsToFloat(place.w); }
// a - b in metres.
vec3 between(ivec4 a, ivec4 b) { return vec3(ivec3(uvec3(a.xyz) - uvec3(b.xyz))) * params.unit; }
