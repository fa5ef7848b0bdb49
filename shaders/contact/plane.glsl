struct Surface {
  vec3 normal;    // outward
  real distance;  // from it, of a point
};
// Contact with a half space n.x >= d, as an inequality constraint with Coulomb friction at the level of positions
// (method.md eqs. 11-12). `depth`: n.x - d (negative inside); `moved`: the vertex's displacement so far in this
// substep. Friction takes back the tangential part of the displacement, at most friction * the normal correction.
vec3 plane_correction(vec3 n, real depth, vec3 moved, real friction) {
  vec3 slip = moved - n * dot(moved, n);
  real length_squared = dot(slip, slip);
  real grip = -friction * depth;
  if (length_squared > grip * grip) slip *= grip / sqrt(length_squared);
  return depth < real(0) ? -depth * n - slip : vec3(real(0));
}
