// Positions and velocities as unevaluated sums high + low. `precise` keeps the compiler from dropping rounding errors.
struct DoubleSingle {
  vec3 high;
  vec3 low;
};
// a + b, normalised so that `high` is the float nearest to the sum (Knuth's two-sum, then a fast one).
DoubleSingle add_double(DoubleSingle a, vec3 b) {
  precise vec3 s = a.high + b;
  precise vec3 t = s - a.high;
  precise vec3 e = (a.high - (s - t)) + (b - t) + a.low;
  precise vec3 high = s + e;
  precise vec3 low = e - (high - s);
  return DoubleSingle(high, low);
}
// a - b, rounded to float, for neighbours exact to the last bit or two.
vec3 relative(Position a, Position b) {
  precise vec3 d = (a.high - b.high) + (a.low - b.low);
  return d;
}
vec3 relative(DoubleSingle a, DoubleSingle b) {
  precise vec3 d = (a.high - b.high) + (a.low - b.low);
  return d;
}
