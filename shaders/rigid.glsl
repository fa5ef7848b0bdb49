// Rigid handles (method.md eqs. 17-20), as GLSL and as C++. `precise`: both round alike, so that their integers are the same.

// A vertex's weight: mass times a trilinear share, so that the shares of a vertex's eight handles make 1. `vertex`: in cells of the
// handles' lattice, and its mass in units of a weight.
int handle_weight(vec4 vertex, vec3 node) {
  precise vec3 near = max(vec3(1.0f) - abs(vec3(vertex) - node), vec3(0.0f));
  precise float weight = near.x * near.y * near.z * vertex.w + 0.5f;
  return int(floor(weight));
}
// From the handle's centre to a vertex at rest, m.
vec3 handle_arm(vec4 vertex, vec3 centre, vec3 cell) {
  precise vec3 arm = (vec3(vertex) - centre) * cell;
  return arm;
}
// The same in whole steps, at most 2^14.
ivec3 handle_steps(vec3 arm, float steps_per_metre) {
  precise vec3 steps = arm * steps_per_metre + vec3(0.5f);
  return ivec3(floor(steps));
}

// The rotation R with the largest trace(R^T A), for A = sum w x X^T: the one that turns the X nearest to the x (Horn 1987). The sum
// of A's singular values, the smallest one with the sign of det A, is the largest root of a quartic, found from above by Newton's
// method as in Theobald (2005); R follows from it without eigenvectors. The identity where A says nothing: points on a line.
dmat3 rotation_of(dmat3 A) {
  double size = sqrt(dot(A[0], A[0]) + dot(A[1], A[1]) + dot(A[2], A[2]));
  bool some = size > 0.0;
  A /= some ? size : 1.0;
  dmat3 cofactors = dmat3(cross(A[1], A[2]), cross(A[2], A[0]), cross(A[0], A[1]));
  double det = dot(A[0], cofactors[0]);
  dmat3 B = transpose(A) * A;
  double constant = 2.0 * (dot(B[0], B[0]) + dot(B[1], B[1]) + dot(B[2], B[2])) - 1.0;
  double root = sqrt(double(3.0));
  for (int k = 0; k < 24; ++k) {
    double slope = 4.0 * root * (root * root - 1.0) - 8.0 * det;
    double down = (root * root * (root * root - 2.0) - 8.0 * det * root + constant) / (slope > 1e-12 ? slope : 1.0);
    root -= slope > 1e-12 ? down : 0.0;
    if (abs(down) < 1e-15) break;
  }
  double divisor = root * (root * root - 1.0) - 2.0 * det;
  bool sound = some && divisor > 1e-6;
  dmat3 R = ((root * root + 1.0) * A + 2.0 * root * cofactors - 2.0 * A * B) / (sound ? divisor : 1.0);
  return sound ? R : dmat3(1.0);
}
