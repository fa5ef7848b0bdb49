// How leapfrog moves a vertex in a substep of mode explicit (method.md eq. 32).
#include "vertex.glsl"

DoubleSingle move_vertex(uint i, Position own, Velocity speed, vec3 correction) {
  DoubleSingle start = DoubleSingle(own.high, own.low), v = DoubleSingle(speed.high, speed.low);
  // The time from the middle of the last substep to the middle of this one.
  float time = (phases & PHASE_CHANGED) != 0u ? params.h * params.kick : params.h;
  v = add_double(add_double(v, correction * (time * params.inverse_h * params.inverse_h)), pull_on(i) * time);
  v = DoubleSingle(v.high * params.velocity_scale, v.low * params.velocity_scale);
  DoubleSingle x = predict_position(start, v);
  if (may_touch(x, length(params.h * v.high))) {
    DoubleSingle free = x;
    x = resolve_contacts(i, x, params.h * v.high);
    v = add_double(v, relative(x, free) * params.inverse_h);
  }
  stay_listed(i, x, v);
#if LOADED
  speed.work += work_of_loads(i, params.h * v.high, own.inverse_mass);
#endif
  positions[i] = Position(x.high, own.inverse_mass, x.low, own.constraints);
  velocities[i] = Velocity(v.high, speed.work, v.low, 0.0);
  book_work(i, own.inverse_mass);
  note_unless_finite(i, x.high + x.low, v.high + v.low);
  if (params.damping > 0.0) quantized_out[params.vertex_count + i] = quantize(start, 0.0);
  return x;
}
