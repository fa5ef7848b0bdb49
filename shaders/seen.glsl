// What neighbours see of a vertex.
#include "pull.glsl"
DoubleSingle pulled_velocity(DoubleSingle v, vec3 pull) {
  v = add_double(v, pull * params.h);
  return DoubleSingle(v.high * params.velocity_scale, v.low * params.velocity_scale);
}
DoubleSingle predict_velocity(uint i, DoubleSingle v) { return pulled_velocity(v, pull_on(i)); }
DoubleSingle predict_position(DoubleSingle x, DoubleSingle v) {
  precise vec3 move = params.h * v.high;
  return add_double(add_double(x, move), params.h * v.low);
}
// The inverse mass that constraints see. With mass splitting (Tonge et al. 2012) each of n_i constraints has 1/n_i of
// the mass, so that their average keeps momentum (method.md eq. 14).
float weight_of(Position own) {
  return params.mass_splitting > 0.0 ? own.inverse_mass * own.constraints : own.inverse_mass;
}
// Corrections begin where the next prediction will put the vertex, forces where it is.
DoubleSingle seen_by_neighbours(uint i, DoubleSingle x, DoubleSingle v) {
  return LEAPFROG != 0 ? x : predict_position(x, predict_velocity(i, v));
}
// Damping compares with the start of the substep, of forces with where the vertex was one substep earlier.
DoubleSingle place_before(DoubleSingle x, DoubleSingle v) {
  return LEAPFROG != 0 ? predict_position(x, DoubleSingle(-v.high, -v.low)) : x;
}
