// How an item and a target stand to each other, as the kernels of contact ask for it: needs positions and pairs/formulas.glsl.
vec3 from_own(uint vertex, Pair own) {
  Position p = positions[vertex];
  return relative(Pair(p.high, p.low), own);
}
// `t` with its bits. What a sheet keeps from others is taken off the gap.
Meeting meeting_of(uint s, uint t) {
  bool under = (t & UNDER) != 0u;
  t &= TARGET;
  uvec4 vertices = vertices_of(s, t);
  Position p = positions[vertices.x];
  Pair own = Pair(p.high, p.low);
  vec3 b = from_own(vertices.y, own), c = from_own(vertices.z, own), d = from_own(vertices.w, own);
#if EDGES
  if (item_is_edge(s)) {
    uvec4 beside = beside_of(s, t);
    return meet_edges(b, from_own(beside.x, own), from_own(beside.y, own), c, d, from_own(beside.z, own), from_own(beside.w, own));
  }
#endif
#if SHEETS
  float thickness = thickness_of(triangle_body(t));
  Meeting m;
  if (thickness > 0.0)
    m = meet_sheet(b, c, d, under);
  else
    m = meet(b, c, d);
  m.gap -= max(thickness, thickness_of(surface_body(s)));
  return m;
#else
  return meet(b, c, d);
#endif
}
