// Shape-matching clusters (method.md eqs. 28-31), as GLSL and as C++. `precise`: both round alike, so that their integers are the same.

// A vertex's weight: mass times a trilinear share, so that the shares of a vertex's eight clusters make 1. `vertex`: in cells of the
// clusters' lattice, and its mass in units of a weight.
int cluster_weight(vec4 vertex, vec3 node) {
  precise vec3 near = max(vec3(1.0f) - abs(vec3(vertex) - node), vec3(0.0f));
  precise float weight = near.x * near.y * near.z * vertex.w + 0.5f;
  return int(floor(weight));
}
// From the cluster's centre to a vertex at rest, m.
vec3 cluster_arm(vec4 vertex, vec3 centre, vec3 cell) {
  precise vec3 arm = (vec3(vertex) - centre) * cell;
  return arm;
}
// The same in whole steps, at most 2^14.
ivec3 cluster_steps(vec3 arm, float steps_per_metre) {
  precise vec3 steps = arm * steps_per_metre + vec3(0.5f);
  return ivec3(floor(steps));
}

// E, for the rotation 1 + E that turns S + B nearest to symmetric; S is symmetric, `inverse` = (tr S - S)^-1, and B is small against it.
// Two steps of Newton's method with S's matrix in place of the true one, scaled to the true trace; no step exceeds half a radian,
// whatever comes in. Without the 1, which would round what is added to it.
mat3 small_rotation(mat3 S, mat3 B, mat3 inverse_) {
  mat3 E = mat3(0.0f);
  float trace = S[0].x + S[1].y + S[2].z;
  for (int k = 0; k < 2; ++k) {
    mat3 C = B + transpose(E) * (S + B);  // and S, which is symmetric and would only round it
    float scale = trace / max(abs(C[0].x + C[1].y + C[2].z + trace), 0.1f * trace + 1e-30f);
    vec3 turn = inverse_ * vec3(C[1].z - C[2].y, C[2].x - C[0].z, C[0].y - C[1].x) * scale;
    turn *= 0.5f / max(1.0f, 2.0f * length(turn));
    // Cayley: (1 + [t])^2 / (1 + t^2), exactly a rotation.
    float square = dot(turn, turn);
    mat3 cross_ = mat3(vec3(0.0f, turn.z, -turn.y), vec3(-turn.z, 0.0f, turn.x), vec3(turn.y, -turn.x, 0.0f));
    mat3 more = (cross_ + cross_ * cross_) * (2.0f / (1.0f + square));
    E = E + more + E * more;
  }
  return E;
}
