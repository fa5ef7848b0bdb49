// What happens to a vertex besides gathering its corrections: prediction before the first iteration of a substep, contacts in
// each, velocity after the last (method.md eqs. 1-2, 5, 11-13); and what its neighbours see next.
#include "vertex_state.glsl"
layout(std430, binding = BIND_PREDICTED) buffer Predicted { Velocity predicted[]; };  // a Pair, padded
#include "contact.glsl"
#if SHAPES
#include "shape_contact.glsl"
#endif

Pair predict_velocity(Pair v) {
  v = pair_add(v, params.gravity * params.h);
  return Pair(v.high * params.velocity_scale, v.low * params.velocity_scale);
}
Pair predict_position(Pair x, Pair v) {
  precise vec3 move = params.h * v.high;
  return pair_add(pair_add(x, move), params.h * v.low);
}
// The inverse mass that constraints see. With mass splitting (Tonge et al. 2012) each of n_i constraints has 1/n_i of the mass: the
// average over them then keeps momentum (method.md eq. 13m).
float weight_of(Position own) { return params.mass_splitting > 0.0 ? own.inverse_mass * own.constraints : own.inverse_mass; }

bool touches(Pair x) {
  bool any = params.plane_count > 0 && depth_of(x, params.planes[0]) < 0.0;  // mostly there is one, or none
  for (int k = 1; k < params.plane_count; ++k) any = any || depth_of(x, params.planes[k]) < 0.0;
  return any;
}
// Corrects a vertex out of all obstacles; `moved`: its displacement in this substep before the correction.
Pair resolve_contacts(Pair x, vec3 moved) {
  for (int k = 0; k < params.plane_count; ++k) {
    vec4 plane = params.planes[k];
    float depth = depth_of(x, plane);
    if (depth < 0.0) {
      vec3 correction = plane_correction(plane.xyz, depth, moved, params.friction);
      x = pair_add(x, correction);
      moved += correction;
    }
  }
#if SHAPES
  for (uint left = shapes_near(x, length(moved), 1.0); left != 0u;) {
    int k = findLSB(left);
    left &= left - 1u;
    vec3 carried = params.h * shape_velocity(k, x);
    Surface plane = met(k, x, moved - carried);
    if (plane.distance < 0.0) {
      vec3 correction = plane_correction(plane.normal, plane.distance, moved - carried, shapes[k].friction);
      x = pair_add(x, correction);
      moved += correction;
      left = shapes_near(x, length(moved), 1.0) & ~((2u << k) - 1u);
    }
  }
#endif
  return x;
}

#if RIGID_CONTACT
#include "rigid.glsl"
#endif
#if CONTACTS
#include "pairs/sums.glsl"
// What contact with other bodies found after the last substep: where it stops the vertex, its velocity changes as well.
void take_contacts(uint i, inout Position own, inout Velocity speed) {
  uint side = (phases & PHASE_SHARED_SIDE) != 0u ? 1u : 0u, now = sharing(i, side), then = sharing(i, 1u - side), k = sums_of(i);
  int shared_now = pair_sums[now], shared_then = pair_sums[then];
  vec3 stopped, pushed;
  for (uint c = 0u; c < 3u; ++c) {
    stopped[c] = float(pair_sums[k + c]) * (params.quantum / PARTS);
    pushed[c] = float(pair_sums[k + PUSHED + c]) * (params.quantum / PARTS);
  }
  if (shared_then != 0) pair_sums[then] = 0;
  if (shared_now == 0) return;
  if ((phases & PHASE_SHARED_LAST) != 0u) pair_sums[now] = 0;
  for (uint c = 0u; c < 3u; ++c) pair_sums[k + c] = pair_sums[k + PUSHED + c] = 0;
  if (!(own.inverse_mass > 0.0)) return;
  Pair x = pair_add(Pair(own.high, own.low), stopped + pushed), v = pair_add(Pair(speed.high, speed.low), stopped * params.inverse_h);
  own.high = x.high, own.low = x.low, speed.high = v.high, speed.low = v.low;
}
#endif

// Moves vertex i, which is not fixed; returns where its neighbours see it.
Pair moved(uint i, Position own, Velocity speed, vec3 correction) {
  bool predicts = (phases & PHASE_PREDICT) != 0u, finishes = (phases & PHASE_FINISH) != 0u;
  Pair x = Pair(own.high, own.low), v = Pair(speed.high, speed.low), start = x;
  bool carried = false;
#if RIGID_CONTACT
  RigidState body = state_at(i);
  carried = body.carried;
#endif
  if (predicts) {
    if (!carried) v = predict_velocity(v);
    start = x = predict_position(x, v);
  }
  if ((phases & PHASE_SOLVE) != 0u) {
    Pair corrected = pair_add(x, correction);
#if SHAPES
    const bool meets = true;  // that depends on where it comes from
#else
    bool meets = touches(corrected);
#endif
    if (meets) {
      vec3 moved = correction;
      if (predicts) moved += params.h * v.high;
      else moved += params.h * velocities[i].high + relative(x, Pair(predicted[i].high, predicted[i].low));
      corrected = resolve_contacts(corrected, moved);
    }
    x = corrected;
  }
  positions[i] = Position(x.high, own.inverse_mass, x.low, own.constraints);
  if (finishes) {
    if (!predicts) start = Pair(predicted[i].high, predicted[i].low);
    if (!carried) v = pair_add(v, relative(x, start) * params.inverse_h);
    note_unless_finite(i, x.high + x.low, v.high + v.low);
  } else if (predicts) {
    predicted[i] = Velocity(start.high, 0.0, start.low, 0.0);
  }
  if (predicts || finishes) velocities[i] = Velocity(v.high, 0.0, v.low, 0.0);
#if COMPLIANT
  if (finishes && params.damping > 0.0) quantized_out[params.vertex_count + i] = quantize(x, 0.0);
#endif
  // After the last iteration neighbours need the next substep's prediction: it is their first iteration's start.
  if (finishes) {
    Pair here = x;
    x = predict_position(x, predict_velocity(v));
#if RIGID_CONTACT
    note_motion(body, i, here, v, x, own.inverse_mass);
#endif
  }
  return x;
}
#if LEAPFROG
// The same in mode explicit (method.md eq. 39): the force where the vertex is, then the way.
Pair leapt(uint i, Position own, Velocity speed, vec3 correction) {
  Pair start = Pair(own.high, own.low), v = Pair(speed.high, speed.low);
  // From the middle of the last substep to the middle of this.
  float time = (phases & PHASE_CHANGED) != 0u ? params.h * params.kick : params.h;
  v = pair_add(pair_add(v, correction * (time * params.inverse_h * params.inverse_h)), params.gravity * time);
  v = Pair(v.high * params.velocity_scale, v.low * params.velocity_scale);
  Pair x = predict_position(start, v);
#if SHAPES
  bool meets = touches(x) || shapes_near(x, length(params.h * v.high), 1.0) != 0u;
#else
  bool meets = touches(x);
#endif
  if (meets) {
    Pair free = x;
    x = resolve_contacts(x, params.h * v.high);
    v = pair_add(v, relative(x, free) * params.inverse_h);
  }
  positions[i] = Position(x.high, own.inverse_mass, x.low, own.constraints);
  velocities[i] = Velocity(v.high, 0.0, v.low, 0.0);
  note_unless_finite(i, x.high + x.low, v.high + v.low);
  if (params.damping > 0.0) quantized_out[params.vertex_count + i] = quantize(start, 0.0);
  return x;
}
#endif

// Reads and writes vertex i alone. `own`: its position; `speed`: its velocity, read if the phases
// predict or finish.
void advance(uint i, Position own, Velocity speed, vec3 correction) {
#if CONTACTS
  if ((phases & PHASE_TOUCHED) != 0u) take_contacts(i, own, speed);
#endif
  Pair x = Pair(own.high, own.low);
  if (own.inverse_mass > 0.0) {
#if LEAPFROG
    x = leapt(i, own, speed, correction);
#else
    x = moved(i, own, speed, correction);
#endif
  } else if ((phases & PHASE_FINISH) != 0u) {
    note_unless_finite(i, x.high + x.low, vec3(0.0));
#if RIGID_CONTACT
    note_fixed(i);
#endif
#if COMPLIANT
    if (params.damping > 0.0) quantized_out[params.vertex_count + i] = quantize(x, 0.0);
#endif
  }
  quantized_out[i] = quantize(x, weight_of(own));
}
