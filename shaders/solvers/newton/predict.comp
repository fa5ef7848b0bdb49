// Where inertia takes each vertex (method.md eq. 40), and where it is at each of Newton's starts. One invocation per
// vertex.
#include "solvers/newton/newton.glsl"
void main() {
  uint i = group_index() * GROUP_SIZE + gl_LocalInvocationIndex;
  if (i < 3u) bad_starts[i] = 0u;
  if (i >= VERTICES) return;
  begin_body(i);
  Position own = positions[i];
  DoubleSingle x = DoubleSingle(own.high, own.low);
  bool fixed_ = own.inverse_mass <= 0.0, known = is_step_known(i);
  float h = known ? params.h * (2.0 / 3.0) : params.h;
  vec3 offset = vec3(0.0), speed = velocities[i].high + velocities[i].low;
  if (known) {
    offset = at(DISPLACEMENT, i).xyz / 3.0;
    speed += at(GAIN, i).xyz / 3.0;
  }
  float drag = 1.0 + params.drag * h;
  vec3 aim = offset + (h * speed + ((known ? 1.0 : 0.5) * h * h) * params.gravity) / drag;
  if (fixed_) offset = aim = vec3(0.0);
  put(AIM, i, aim, fixed_ ? 0.0 : drag / (own.inverse_mass * h * h));
  put(OFFSET, i, offset, h);
  for (uint k = 0u; k < 4u; ++k) {
    ivec4 start = quantize(fixed_ ? x : add_double(x, kept_out(x, start_fractions[k] * aim)), 0.0);
    vectors[(RESIDUAL + k) * VERTICES + i] = intBitsToFloat(start);
  }
}
