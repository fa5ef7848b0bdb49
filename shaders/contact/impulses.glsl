// A rigid body on obstacles: inelastic impacts and Coulomb friction by impulses, each contact in turn (method.md eqs.
// 34-37). GLSL and C++ (sim/model/formulas.h). Impulses and momenta per mass of the body.
struct Rigid {
  vec3 centre;
  vec3 velocity;
  vec3 spin;  // rad/s
  mat3 inverse_inertia;
  bool unsettled;  // impulses still changed when it was left
};
struct Touch {
  vec3 normal;
  vec3 arm;       // from the centre
  real least;     // the normal velocity that is left, at least
  vec3 impulse;
  mat3 response;  // velocity there per impulse there
  mat3 stopping;  // its inverse
#if SOLIDS  // else obstacles rest, and have the world's friction
  vec3 surface;   // the obstacle's velocity there
  real friction;
#endif
};
// The inverse inertia from the second moments of the mass about the centre; 0 where it has none, as all is on a line.
mat3 inverse_inertia_of(mat3 moments) {
  real trace = moments[0][0] + moments[1][1] + moments[2][2];
  mat3 inertia = mat3(trace) - moments;
  return determinant(inertia) > real(1e-6) * trace * trace * trace ? inverse(inertia) : mat3(real(0));
}
bool has_inertia(Rigid b) { return b.inverse_inertia[0][0] > real(0); }
vec3 velocity_at(Rigid b, vec3 arm) { return b.velocity + cross(b.spin, arm); }
// `approach`: normal velocity before; under what gravity alone makes of it in two substeps there is no rebound. `gap`:
// closed in h at most, but for one that rounding may have opened.
const real closed_gap = real(1e-6);  // of the body's size
real least_velocity(real approach, real gap, real h, real fall, real restitution) {
  return restitution > real(0) && approach < real(-2) * fall ? -restitution * approach : -max(gap, real(0)) / h;
}
Touch touch_at(Rigid b, vec3 normal, vec3 arm, real least, vec3 impulse, vec3 surface, real friction) {
  mat3 turn = mat3(real(0), arm.z, -arm.y, -arm.z, real(0), arm.x, arm.y, -arm.x, real(0));  // turn * p = cross(arm, p)
  mat3 response = mat3(real(1)) + transpose(turn) * b.inverse_inertia * turn;
#if SOLIDS
  return Touch(normal, arm, least, impulse, response, inverse(response), surface, friction);
#else
  return Touch(normal, arm, least, impulse, response, inverse(response));
#endif
}
Rigid pushed(Rigid b, vec3 arm, vec3 impulse) {
  b.velocity += impulse;
  b.spin += b.inverse_inertia * cross(arm, impulse);
  return b;
}
// The impulse at a contact while all others stay as they are: the one that stops it, if friction can; else the limit of
// friction against the slip that is left. `velocity`: there, with the contact's impulse so far in it.
vec3 impulse_at(Touch t, vec3 velocity, real friction) {
  vec3 n = t.normal, was = t.impulse, impulse = was - t.stopping * (velocity - t.least * n);
  real push = dot(impulse, n), grip = length(impulse - push * n);
  if (push <= real(0) || grip > friction * push) {
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
      if (grip > friction * push) held *= friction * push / grip;
      impulse = held + push * n;
    }
  }
  return impulse;
}
#if SOLIDS
#define SLIP_OF(k, v) (v - contacts[k].surface), contacts[k].friction
#else
#define SLIP_OF(k, v) v, params.friction
#endif
SHARED_TOUCHES
// Over the contacts in `contacts` until no impulse changes by more than `enough`; a body slower than `still` in the end
// stands still.
Rigid settled(TOUCHES Rigid b, int count, real enough, real still) {
  real change = enough + enough;
  for (int sweep = 0; sweep < 200 && change > enough; ++sweep) {
    change = real(0);
    for (int k = 0; k < count; ++k) {
      vec3 arm = contacts[k].arm, impulse = impulse_at(contacts[k], SLIP_OF(k, velocity_at(b, arm))),
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
