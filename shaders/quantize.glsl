// A quantized position is in whole quanta modulo 2^32, with the inverse mass (times n_i for mass splitting) as float
// bits. Differences wrap too, so they are exact wherever the body is, as long as the vertices of a constraint are
// within 2^31 quanta of each other (method.md, "Quantized positions").
ivec4 quantize(DoubleSingle x, float weight) {
  // In halves of 16 bits, as a float holds neither 2^32 nor a small negative number plus 2^32.
  float per_metre = COARSE(params.inverse_quantum);
  vec3 quanta = x.high * per_metre;
  vec3 upper = floor(quanta / 65536.0);
  vec3 lower = (quanta - upper * 65536.0) + x.low * per_metre;
  upper -= floor(upper / 65536.0) * 65536.0;
  uvec3 whole = uvec3(upper) * 65536u + uvec3(ivec3(floor(lower + 0.5)));
  return ivec4(ivec3(whole), floatBitsToInt(weight));
}
float inverse_mass_of(ivec4 q) { return intBitsToFloat(q.w); }
// a - b, m.
vec3 between(ivec4 a, ivec4 b) { return vec3(ivec3(uvec3(a.xyz) - uvec3(b.xyz))) * FINE(params.quantum); }
