// What neighbours see of a vertex, its quantized position: whole quanta modulo 2^32 in each component, with the inverse
// mass (times n_i for mass splitting) as float bits. Differences wrap as well, so they are exact wherever the body is,
// as long as the vertices of a constraint are within 2^31 quanta of each other (method.md, "What neighbours see"). With
// compliance as many follow: where the vertices were at the substep's start. Halves of 16 bits: a float holds neither
// 2^32 nor a small negative number plus 2^32.
ivec4 quantize(DoubleSingle x, float weight) {
  vec3 quanta = x.high * params.inverse_quantum;
  vec3 upper = floor(quanta / 65536.0);
  vec3 lower = (quanta - upper * 65536.0) + x.low * params.inverse_quantum;
  upper -= floor(upper / 65536.0) * 65536.0;
  uvec3 whole = uvec3(upper) * 65536u + uvec3(ivec3(floor(lower + 0.5)));
  return ivec4(ivec3(whole), floatBitsToInt(weight));
}
float inverse_mass_of(ivec4 q) { return intBitsToFloat(q.w); }
// a - b in metres.
vec3 between(ivec4 a, ivec4 b) { return vec3(ivec3(uvec3(a.xyz) - uvec3(b.xyz))) * params.quantum; }
