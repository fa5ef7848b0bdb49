// What happens to a vertex besides gathering its corrections: prediction before the first iteration of a substep, contacts in
// each, velocity after the last (method.md eqs. 1-2, 5, 11-13); and what its neighbours see next, its place.
layout(std430, binding = BIND_POSITIONS) buffer Positions { Position positions[]; };
layout(std430, binding = BIND_VELOCITIES) buffer Velocities { Velocity velocities[]; };
layout(std430, binding = BIND_PREDICTED) buffer Predicted { Velocity predicted[]; };  // a Pair, padded
#include "contact.glsl"
#include "first_bad.glsl"

Pair predict_velocity(Pair v) {
  v = pair_add(v, params.gravity * params.h);
  return Pair(v.high * params.keep, v.low * params.keep);
}
Pair predict_position(Pair x, Pair v) {
  precise vec3 move = params.h * v.high;
  return pair_add(pair_add(x, move), params.h * v.low);
}
// The inverse mass that constraints see. With mass splitting (Tonge et al. 2012) each of n_i constraints has 1/n_i of the mass: the
// average over them then keeps momentum (method.md eq. 13m).
float weight_of(Position own) { return params.mass_splitting > 0.0 ? own.inverse_mass * own.constraints : own.inverse_mass; }
ivec4 predicted_place(Position own, Velocity speed) {
  Pair x = Pair(own.high, own.low);
  if (own.inverse_mass > 0.0) x = predict_position(x, predict_velocity(Pair(speed.high, speed.low)));
  return place_of(x, weight_of(own));
}

// Moves vertex i, which is not fixed; returns where its neighbours see it.
Pair moved(uint i, Position own, Velocity speed, vec3 correction) {
  uint phase = turn.x;
  Pair x = Pair(own.high, own.low), v = Pair(speed.high, speed.low), start = x;
  if ((phase & PHASE_PREDICT) != 0u) {
    v = predict_velocity(v);
    start = x = predict_position(x, v);
  }
  if ((phase & PHASE_SOLVE) != 0u) {
    Pair corrected = pair_add(x, correction);
    if ((phase & PHASE_CONTACT) != 0u && touches(corrected)) {
      vec3 moved = correction;
      if ((phase & PHASE_PREDICT) != 0u) moved += params.h * v.high;
      else moved += params.h * velocities[i].high + relative(x, Pair(predicted[i].high, predicted[i].low));
      corrected = resolve_contacts(corrected, moved);
    }
    x = corrected;
  }
  positions[i] = Position(x.high, own.inverse_mass, x.low, own.constraints);
  if ((phase & PHASE_FINISH) != 0u) {
    if ((phase & PHASE_PREDICT) == 0u) start = Pair(predicted[i].high, predicted[i].low);
    v = pair_add(v, relative(x, start) * params.inverse_h);
    note_unless_finite(i, turn.y, x.high + x.low, v.high + v.low);
  } else if ((phase & PHASE_PREDICT) != 0u) {
    predicted[i] = Velocity(start.high, 0.0, start.low, 0.0);
  }
  if ((phase & (PHASE_PREDICT | PHASE_FINISH)) != 0u) velocities[i] = Velocity(v.high, 0.0, v.low, 0.0);
#ifdef DAMPED
  if ((phase & PHASE_FINISH) != 0u) places_out[params.vertex_count + i] = place_of(x, 0.0);
#endif
  // After the last iteration neighbours need the next substep's prediction: it is their first iteration's start.
  if ((phase & PHASE_FINISH) != 0u) x = predict_position(x, predict_velocity(v));
  return x;
}
// Reads and writes vertex i alone; returns its new place. `own`: its position; `speed`: its velocity, read if the phase predicts or
// finishes.
ivec4 advance(uint i, Position own, Velocity speed, vec3 correction) {
  Pair x = Pair(own.high, own.low);
  if (own.inverse_mass > 0.0) x = moved(i, own, speed, correction);
  else if ((turn.x & PHASE_FINISH) != 0u) note_unless_finite(i, turn.y, x.high + x.low, vec3(0.0));
#ifdef DAMPED
  if (own.inverse_mass <= 0.0 && (turn.x & PHASE_FINISH) != 0u) places_out[params.vertex_count + i] = place_of(x, 0.0);
#endif
  ivec4 place = place_of(x, weight_of(own));
  places_out[i] = place;
  return place;
}
