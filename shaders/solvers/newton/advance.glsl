// p = z + beta p, q = A z + beta q, s += alpha p, r -= alpha q.
struct Advanced {
  vec3 direction, image, step, residual;
};
Advanced advanced(uint i, Lengths l) {
  vec3 p = at(SEARCH, i).xyz + l.beta * at(DIRECTION, i).xyz, q = at(PRODUCT, i).xyz + l.beta * at(IMAGE, i).xyz;
  return Advanced(p, q, at(STEP, i).xyz + l.alpha * p, at(RESIDUAL, i).xyz - l.alpha * q);
}
