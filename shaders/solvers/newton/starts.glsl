// Writes and returns where inertia takes vertex i: by BDF2 if `history`, else by implicit Euler. What pulls it acts
// for a part of the step: a half to begin a fall exactly, the whole where something holds the body.
vec3 predict(uint i, bool history, float part) {
  Position own = positions[i];
  bool fixed_ = own.inverse_mass <= 0.0;
  float h = history ? params.h * (2.0 / 3.0) : params.h;
  vec3 offset = vec3(0.0), speed = velocities[i].high + velocities[i].low;
  if (history) {
    // Of a substep as long as this one, where those before were longer or shorter.
    float as_long = (phases & PHASE_CHANGED) != 0u ? 1.0 / (2.0 * params.kick - 1.0) : 1.0;
    offset = at(DISPLACEMENT, i).xyz * as_long / 3.0;
    speed += at(GAIN, i).xyz * as_long / 3.0;
  }
  float drag = 1.0 + params.drag * h;
  vec3 aim = offset + (h * speed + (part * h * h) * pull_on(i)) / drag;
  if (fixed_) offset = vec3(0.0), aim = params.h * speed;  // the way that it was led
  put(AIM, i, aim, fixed_ ? 0.0 : drag / (own.inverse_mass * h * h));
  put(OFFSET, i, offset, h);
  return aim;
}
// Writes where vertex i is at each of Newton's starts, of which the furthest displacement is `aim`.
void write_starts(uint i, DoubleSingle x, vec3 aim) {
  begin_body(i);
  bool fixed_ = !(positions[i].inverse_mass > 0.0);
  for (uint k = 0u; k < 4u; ++k) {
    ivec4 start = quantize(fixed_ ? x : add_double(x, kept_out(x, start_fractions[k] * aim)), 0.0);
    vectors[(RESIDUAL + k) * VERTICES + i] = intBitsToFloat(start);
  }
}
