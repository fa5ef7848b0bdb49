// The motion of a vertex, apart from gathering its corrections or forces. A kernel that includes this file also
// includes a scheme of solvers/, corrections.glsl or leapfrog.glsl, that defines move_vertex().
#include "vertex_state.glsl"
#include "contact/obstacles.glsl"
#include "seen.glsl"

#if RIGID_CONTACT
#include "contact/rigid.glsl"
#endif
#if CONTACTS
layout(binding = UNIT_LISTED) uniform samplerBuffer listed_places;  // and how far from there a vertex may be, m
// Stops a vertex that would go where no pairs of surfaces were looked for (contact/bodies/find.comp). Those that have
// pairs move later (contact/bodies/truncate.comp).
void stay_listed(uint i, inout DoubleSingle x, inout DoubleSingle v) {
  if ((phases & PHASE_NEAR) == 0u) return;
  vec4 listed = texelFetch(listed_places, int(i));
  vec3 away = x.high - listed.xyz, way = params.h * v.high;
  if (floatBitsToInt(listed.w) <= 0 || length(away) <= listed.w) return;
  float part = clamp((listed.w - length(away - way)) / length(way), 0.0, 1.0);
  x = add_double(x, (part - 1.0) * way);
  v = DoubleSingle(part * v.high, part * v.low);
  atomicAdd(dropped[DROP_SPEED], 1u);
}
#else
void stay_listed(uint i, DoubleSingle x, DoubleSingle v) {}
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
  begin_body(i);
  DoubleSingle x = DoubleSingle(own.high, own.low);
  if (own.inverse_mass > 0.0) {
    x = move_vertex(i, own, speed, correction);
  } else if ((phases & PHASE_FINISH) != 0u) {
    note_unless_finite(i, x.high + x.low, vec3(0.0));
#if RIGID_CONTACT
    note_fixed(i);
#endif
#if COMPLIANT && QUANTIZED
    if (params.damping > 0.0) quantized_out[params.vertex_count + i] = quantize(x, 0.0);
#endif
  }
#if QUANTIZED
  quantized_out[i] = quantize(x, weight_of(own));
#endif
}
