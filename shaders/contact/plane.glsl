struct Surface {
  vec3 normal;    // outward
  real distance;  // signed, of a point from it
};
// Contact with a half space n.x >= d as a constraint on positions, with Coulomb friction (method.md eqs. 48-49), which
// takes back the tangential displacement by at most friction * the normal correction. `depth`: n.x - d; `moved`: the
// vertex's displacement so far in this substep.
vec3 plane_correction(vec3 n, real depth, vec3 moved, real friction) {
  vec3 slip = moved - n * dot(moved, n);
  real length_squared = dot(slip, slip);
  real grip = -friction * depth;
  if (length_squared > grip * grip) slip *= grip / sqrt(length_squared);
  return depth < real(0) ? -depth * n - slip : vec3(real(0));
}
