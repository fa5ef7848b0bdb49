// Contact of a rigid body with obstacles: inelastic impacts and Coulomb friction by impulses, each contact in turn
// (method.md eqs. 52-55). Impulses and momenta are per mass of the body. GLSL and C++ (sim/model/formulas.h).
struct Rigid {
  vec3 centre;
  vec3 velocity;
  vec3 spin;  // rad/s
  mat3 inverse_inertia;
  bool unsettled;  // impulses did not converge
};
struct Touch {
  vec3 normal;
  vec3 arm;       // from the centre
  real least;     // the least normal velocity allowed
  vec3 impulse;
  mat3 response;  // velocity at the contact per impulse
  mat3 stopping;  // its inverse
  vec3 surface;   // the obstacle's velocity at the contact
  real friction;
};
// From the second moments of the mass about the centre; 0 if there is no inertia about some axis, as of a line.
mat3 inverse_inertia_of(mat3 moments) {
  real trace = moments[0][0] + moments[1][1] + moments[2][2];
  mat3 inertia = mat3(trace) - moments;
  return determinant(inertia) > real(1e-6) * trace * trace * trace ? inverse(inertia) : mat3(real(0));
}
bool has_inertia(Rigid b) { return b.inverse_inertia[0][0] > real(0); }
vec3 velocity_at(Rigid b, vec3 arm) { return b.velocity + cross(b.spin, arm); }
// The least normal velocity allowed after one of `approach`. A body rebounds only if it is faster than gravity makes it
// in two substeps (`fall`: in one); else it may close `gap` in h, less closed_gap.
const real closed_gap = real(1e-6);  // of the body's size, which rounding may have opened
real least_velocity(real approach, real gap, real h, real fall, real restitution) {
  return restitution > real(0) && approach < real(-2) * fall ? -restitution * approach : -max(gap, real(0)) / h;
}
Touch touch_at(Rigid b, vec3 normal, vec3 arm, real least, vec3 impulse, vec3 surface, real friction) {
  mat3 turn = mat3(real(0), arm.z, -arm.y, -arm.z, real(0), arm.x, arm.y, -arm.x, real(0));  // turn * p = cross(arm, p)
  mat3 response = mat3(real(1)) + transpose(turn) * b.inverse_inertia * turn;
  return Touch(normal, arm, least, impulse, response, inverse(response), surface, friction);
}
Rigid pushed(Rigid b, vec3 arm, vec3 impulse) {
  b.velocity += impulse;
  b.spin += b.inverse_inertia * cross(arm, impulse);
  return b;
}
// The impulse at a contact while all others stay as they are: the one that stops it, if friction can; else friction is
// at its limit, against the remaining slip. `velocity`: relative to the obstacle, with the contact's impulse so far.
vec3 impulse_at(Touch t, vec3 velocity) {
  vec3 n = t.normal, was = t.impulse, impulse = was - t.stopping * (velocity - t.least * n);
  real push = dot(impulse, n), grip = length(impulse - push * n);
  if (push <= real(0) || grip > t.friction * push) {
    impulse = was;
    for (int turn = 0; turn < 8; ++turn) {
      vec3 now = velocity + t.response * (impulse - was);
      push = max(real(0), dot(impulse, n) - (dot(now, n) - t.least) / dot(n, t.response * n));
      vec3 held = impulse - n * dot(impulse, n);
      now = velocity + t.response * (held + push * n - was);
      vec3 slip = now - n * dot(now, n);
      real speed = dot(slip, slip);
      if (speed > real(0)) held -= slip * (speed / dot(slip, t.response * slip));
      grip = length(held);
      if (grip > t.friction * push) held *= t.friction * push / grip;
      impulse = held + push * n;
    }
  }
  return impulse;
}
// How a rotation moves r, with s along its axis, as long as the tangent of half its angle.
vec3 moved_by_turn(vec3 s, vec3 r) {
  vec3 c = cross(s, r);
  return (c + cross(s, c)) * (real(2) / (real(1) + dot(s, s)));
}
// The s of a rotation by the vector a, rad: library functions are not exact enough at small angles.
vec3 half_tangent(vec3 a) {
  real t = dot(a, a);
  return a * (real(0.5) + t * (real(1) / real(24) + t / real(240)));
}
// The s of a free body's rotation in h, with the spin that its angular momentum gives it halfway.
vec3 turn_in_flight(mat3 inverse_inertia, vec3 angular, real h) {
  vec3 s = half_tangent(inverse_inertia * angular * (h * real(0.5)));
  vec3 spin = inverse_inertia * (angular + moved_by_turn(-s, angular));
  return half_tangent((spin + moved_by_turn(s, spin)) * h);
}
SHARED_TOUCHES
// Sweeps over `contacts` until no impulse changes by more than `enough`; a body slower than `still` is then stopped.
Rigid settled(TOUCHES Rigid b, int count, real enough, real still) {
  real change = enough + enough;
  for (int sweep = 0; sweep < 200 && change > enough; ++sweep) {
    change = real(0);
    for (int k = 0; k < count; ++k) {
      vec3 arm = contacts[k].arm, impulse = impulse_at(contacts[k], velocity_at(b, arm) - contacts[k].surface),
           more = impulse - contacts[k].impulse;
      b = pushed(b, arm, more);
      change = max(change, length(more));
      contacts[k].impulse = impulse;
    }
    if (count == 1) change = real(0);
  }
  b.unsettled = change > enough;
  real reach = real(0);
  for (int k = 0; k < count; ++k) reach = max(reach, length(contacts[k].arm));
  if (length(b.velocity) + reach * length(b.spin) < still) b.velocity = b.spin = vec3(real(0));
  return b;
}
