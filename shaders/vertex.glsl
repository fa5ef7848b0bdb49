// The motion of a vertex, apart from gathering its corrections or forces. A kernel that includes this file also
// includes a scheme of solvers/, corrections.glsl or leapfrog.glsl, that defines move_vertex().
#include "vertex_state.glsl"
#include "contact/obstacles.glsl"

DoubleSingle predict_velocity(DoubleSingle v) {
  v = add_double(v, params.gravity * params.h);
  return DoubleSingle(v.high * params.velocity_scale, v.low * params.velocity_scale);
}
DoubleSingle predict_position(DoubleSingle x, DoubleSingle v) {
  precise vec3 move = params.h * v.high;
  return add_double(add_double(x, move), params.h * v.low);
}
// The inverse mass that constraints see. With mass splitting (Tonge et al. 2012) each of n_i constraints has 1/n_i of
// the mass, so that their average keeps momentum (method.md eq. 13m).
float weight_of(Position own) {
  return params.mass_splitting > 0.0 ? own.inverse_mass * own.constraints : own.inverse_mass;
}

#if RIGID_CONTACT
#include "contact/rigid.glsl"
#endif
#if CONTACTS
#include "contact/bodies/sums.glsl"
// Applies the corrections of contact with other bodies after the last substep. Those that stop the vertex also change
// its velocity.
void apply_contacts(uint i, inout Position own, inout Velocity speed) {
  uint side = (phases & PHASE_SHARED_SIDE) != 0u ? 1u : 0u, now = shared_at(i, side), then = shared_at(i, 1u - side);
  int shared_now = sharing[now], shared_then = sharing[then];
  vec3 stopped, pushed;
  for (uint c = 0u; c < 3u; ++c) {
    stopped[c] = float(contact_sums[i].stopped[c]) * (params.quantum / SUM_PARTS);
    pushed[c] = float(contact_sums[i].pushed[c]) * (params.quantum / SUM_PARTS);
  }
  if (shared_then != 0) sharing[then] = 0;
  if (shared_now == 0) return;
  if ((phases & PHASE_SHARED_LAST) != 0u) sharing[now] = 0;
  for (uint c = 0u; c < 3u; ++c) contact_sums[i].stopped[c] = contact_sums[i].pushed[c] = 0;
  if (!(own.inverse_mass > 0.0)) return;
  DoubleSingle x = add_double(DoubleSingle(own.high, own.low), stopped + pushed),
       v = add_double(DoubleSingle(speed.high, speed.low), stopped * params.inverse_h);
  own.high = x.high, own.low = x.low, speed.high = v.high, speed.low = v.low;
}
#endif

// Books the work of obstacles that moved a vertex and so changed its velocity.
void book_work(uint i, float inverse_mass) {
#if MOVING_SOLIDS
  if (along_obstacles != 0.0) velocities[i].work += along_obstacles * params.inverse_h / inverse_mass;
#endif
}
// Moves vertex i, which is not fixed, and returns the position that its neighbours see.
DoubleSingle move_vertex(uint i, Position own, Velocity speed, vec3 correction);

// Reads and writes vertex i alone. `own`: its position; `speed`: its velocity, read if the phases predict or finish.
void advance(uint i, Position own, Velocity speed, vec3 correction) {
#if CONTACTS
  if ((phases & PHASE_TOUCHED) != 0u) apply_contacts(i, own, speed);
#endif
  begin_body(i);
  DoubleSingle x = DoubleSingle(own.high, own.low);
  if (own.inverse_mass > 0.0) {
    x = move_vertex(i, own, speed, correction);
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
