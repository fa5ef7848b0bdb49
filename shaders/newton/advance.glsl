// p = z + beta p, q = A z + beta q, s += alpha p, r -= alpha q.
struct Advanced {
  vec3 step;
  vec3 residual;
};
Advanced advance(uint i, Lengths l) {
  vec4 r = at(RESIDUAL, i);
  vec3 p = at(SEARCH, i).xyz + l.beta * at(DIRECTION, i).xyz, q = at(PRODUCT, i).xyz + l.beta * at(IMAGE, i).xyz;
  Advanced now = Advanced(at(STEP, i).xyz + l.alpha * p, r.xyz - l.alpha * q);
  put(DIRECTION, i, p, 0.0);
  put(IMAGE, i, q, 0.0);
  put(STEP, i, now.step, 0.0);
  put(RESIDUAL, i, now.residual, r.w);
  return now;
}
