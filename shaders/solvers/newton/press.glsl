// How a pair of surfaces resists in a substep of mode newton.
struct Press {
  float places[2];  // of the nearest points: weights of a triangle's first two corners, or along both edges
  float stiffness;  // N/m along the normal; 0: it does not act
  float start;      // m, by which it is pressed where the substep begins
  float grip;       // N/m across the normal
  uint _0, _1, _2;
};
layout(std430) restrict buffer Presses { Press presses[]; };
float[4] weights_of(Press c, bool of_edges) {
  float s = c.places[0], t = c.places[1];
  if (of_edges) return float[4](1.0 - s, s, t - 1.0, -t);
  return float[4](1.0, -s, -t, s + t - 1.0);
}
