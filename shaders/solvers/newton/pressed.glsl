// Forces of pairs in two integers, so that their order changes no bit of a sum: what conjugate gradients find spans
// more than one holds.
#define BLOCK_QUANTUM (1.0 / 64.0)  // of inertia's part of the block
#define LOW_QUANTA 16777216.0        // in a high one
// N, a power of two.
float press_quantum() {
  int exponent;
  frexp(16.0 * TOTAL_MASS * params.body_size * params.inverse_h * params.inverse_h, exponent);
  return ldexp(1.0, exponent - 24);
}
vec3 pressed_in(ivec4 high, ivec4 low) {
  float quantum = press_quantum();
  return vec3(high.xyz) * quantum + vec3(low.xyz) * (quantum / LOW_QUANTA);
}
