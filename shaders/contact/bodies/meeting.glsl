// The contact between an item and a target; needs positions and formulas.glsl.
vec3 from_own(uint vertex, DoubleSingle own) {
  Position p = positions[vertex];
  return relative(DoubleSingle(p.high, p.low), own);
}
// `t` has its bits. The gap that a sheet keeps is subtracted.
Contact contact_between(uint s, uint t) {
  bool under = (t & UNDER) != 0u;
  t &= TARGET;
  uvec4 vertices = contact_vertices(s, t);
  Position p = positions[vertices.x];
  DoubleSingle own = DoubleSingle(p.high, p.low);
  vec3 b = from_own(vertices.y, own), c = from_own(vertices.z, own), d = from_own(vertices.w, own);
#if EDGES
  if (item_is_edge(s)) {
    uvec4 beside = vertices_beside(s, t);
    return edge_edge_contact(b, from_own(beside.x, own), from_own(beside.y, own), c, d, from_own(beside.z, own),
                             from_own(beside.w, own));
  }
#endif
  Contact m = vertex_triangle_contact(b, c, d);
#if SHEETS
  float thickness = thickness_of(triangle_body(t));
  if (thickness > 0.0) m = vertex_sheet_contact(m, b, c, d, under);
  float apart = max(thickness, thickness_of(surface_body(s)));
  m.gap -= apart;
  m.in_doubt = m.in_doubt && apart == 0.0;
#endif
  return m;
}
Contact turn_inside(Contact m) {
  m.gap = -m.gap;
  m.normal = -m.normal;
  return m;
}
// Whether the vertex is in a tet of the body of triangle t, at most a few tets behind it; false at inverted tets.
bool is_behind(uint s, uint t) {
  vec3 own = positions[surface_vertex(s)].high;
  uint tet = behind[t];
  for (uint turn = 0u; turn < 6u && tet != NONE; ++turn) {
    uvec4 v = tet_vertices[tet];
    Parts parts = tet_parts(positions[v.x].high - own, positions[v.y].high - own, positions[v.z].high - own,
                            positions[v.w].high - own);
    uint least = 0u, small = 0u;
    float whole = parts.volumes[0] + parts.volumes[1] + parts.volumes[2] + parts.volumes[3], least_share = 1e-3 * whole;
    if (!(whole > 0.0)) return false;
    for (uint k = 0u; k < 4u; ++k) {
      if (parts.volumes[k] < parts.volumes[least]) least = k;
      if (parts.volumes[k] <= least_share) ++small;
    }
    uint beyond = tet_beyond[tet][least];
    // A vertex on the surface is not inside, but one on a face between two tets is.
    if (small == 0u || (small == 1u && beyond != NONE && parts.volumes[least] >= -least_share)) return true;
    tet = beyond;
  }
  return false;
}
