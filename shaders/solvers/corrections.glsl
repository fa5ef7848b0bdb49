// How corrections move a vertex in a substep: prediction before the first iteration, contacts in each, and the velocity
// after the last (method.md eqs. 1-2, 4, 13, 48-49).
#include "vertex.glsl"
// Predicted positions stay from the first iteration of a substep to the last, behind the velocities: kernels have room
// for 8 storage blocks.
#define PREDICTED(i) velocities[params.vertex_count + i]

DoubleSingle move_vertex(uint i, Position own, Velocity speed, vec3 correction) {
  bool predicts = (phases & PHASE_PREDICT) != 0u, finishes = (phases & PHASE_FINISH) != 0u;
  DoubleSingle x = DoubleSingle(own.high, own.low), v = DoubleSingle(speed.high, speed.low), start = x;
  bool carried = false;
#if RIGID_CONTACT
  RigidState body = state_at(i);
  carried = body.carried;
#endif
  if (predicts) {
    if (!carried) v = predict_velocity(i, v);
    start = x = predict_position(x, v);
  }
  if ((phases & PHASE_SOLVE) != 0u) {
    DoubleSingle corrected = add_double(x, correction);
    if (may_touch(corrected)) {
      vec3 moved = correction;
      if (predicts) moved += params.h * v.high;
      else moved += params.h * velocities[i].high + relative(x, DoubleSingle(PREDICTED(i).high, PREDICTED(i).low));
      corrected = resolve_contacts(i, corrected, moved);
    }
    x = corrected;
  }
  if (finishes) {
    if (!predicts) start = DoubleSingle(PREDICTED(i).high, PREDICTED(i).low);
    if (!carried) v = add_double(v, relative(x, start) * params.inverse_h);
    stay_listed(i, x, v);
    note_unless_finite(i, x.high + x.low, v.high + v.low);
  } else if (predicts) {
    PREDICTED(i) = Velocity(start.high, 0.0, start.low, 0.0);
  }
  positions[i] = Position(x.high, own.inverse_mass, x.low, own.constraints);
  DoubleSingle kept = v;
#if RIGID_CONTACT && CONTACTS
  // Pairs of surfaces look back to where the vertex was; then carry.comp gives it the velocity of its body.
  if (carried && finishes && (phases & PHASE_NEAR) != 0u) kept = add_double(v, relative(x, start) * params.inverse_h);
#endif
#if LOADED
  if (finishes) speed.work += work_of_loads(i, params.h * v.high, own.inverse_mass);
#endif
  if (predicts || finishes) velocities[i] = Velocity(kept.high, speed.work, kept.low, 0.0);
  if (!carried) book_work(i, own.inverse_mass);
#if COMPLIANT && QUANTIZED
  if (finishes && params.damping > 0.0) quantized_out[params.vertex_count + i] = quantize(x, 0.0);
#endif
  if (finishes) {
    DoubleSingle here = x;
    x = seen_by_neighbours(i, x, v);
#if RIGID_CONTACT
    note_motion(body, i, here, v, x, correction, own.inverse_mass);
#endif
  }
  return x;
}
