// The point of a triangle that is deepest in a solid, or nearest to it: the deepest of a lattice of points, then of its
// neighbours in steps that get shorter (after Macklin et al. 2020, Local Optimization for Robust Signed Distance Field
// Collision). GLSL and C++ (sim/model/formulas.h); the corners are in the solid's own coordinates.
struct Deepest {
  vec3 weights;  // of the corners
  Surface surface;
};
Deepest deepest_point(Solid s, vec3 a, vec3 b, vec3 c) {
  const int parts = 4, of_lattice = 15, rounds = 5;
  Deepest found = Deepest(vec3(1, 0, 0), Surface(vec3(0), real(1e30)));
  vec3 from = found.weights;
  real stride = real(1) / real(parts);
  int i = 0, j = 0;
  // All points share one call, because the code of distances is long.
  for (int turn = 0; turn < of_lattice + 6 * rounds; ++turn) {
    vec3 w = vec3(real(i), real(j), real(parts - i - j)) / real(parts);
    if (turn < of_lattice) {
      ++j;
      if (j > parts - i) {
        ++i;
        j = 0;
      }
    } else {
      int k = (turn - of_lattice) % 6;
      if (k == 0) {
        from = found.weights;
        stride *= real(0.5);
      }
      w = from;
      w[k / 2] -= stride;
      w[(k / 2 + 1 + k % 2) % 3] += stride;
      w = max(w, vec3(0));
      w /= w.x + w.y + w.z;
    }
    Surface here = surface_of(s, w.x * a + w.y * b + w.z * c);
    if (here.distance < found.surface.distance) found = Deepest(w, here);
  }
  return found;
}
