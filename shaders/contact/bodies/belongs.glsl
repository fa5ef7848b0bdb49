// Whether a pair counts: of all pairs that see each other in the same direction one does. GLSL and C++
// (sim/contact/offset_contact.h), which give between(), from one vertex to another where the substep begins, and the
// surface: corners of triangles, edges with the third corners beside them, neighbours of vertices.
bool leads_off_edge(uint edge, vec3 to) {
  uvec4 e = edge_vertices(edge);
  vec3 along = between(e.x, e.y);
  bool off = true;
  for (int side = 0; side < 2; ++side) {
    uint beside = side == 0 ? e.z : e.w;
    vec3 across = between(e.x, beside == NONE ? e.y : beside);
    bool away = leads_away(to, across - along * (dot(across, along) / dot(along, along)));
    off = off && (away || beside == NONE);
  }
  return off;
}
bool leads_off_vertex(uint vertex, vec3 to) {
  bool off = true;
  uint end = first_neighbour_of(vertex + 1u);
  for (uint k = first_neighbour_of(vertex); k < end; ++k) {
    bool away = leads_away(to, between(vertex, neighbour_at(k)));
    off = off && away;
  }
  return off;
}
bool belongs(Proximity t, bool edges, uint first, uint second) {
  if (edges) {
    if (t.part != 0) return false;
    bool off_first = leads_off_edge(first, -t.normal), off_second = leads_off_edge(second, t.normal);
    return off_first && off_second;
  }
  if (t.part == 0) return true;
  uvec4 corners = triangle_corners(second);
  if (t.part < 4) {
    uint edge = edge_of_triangle(second, t.part - 1);
    return edge_vertices(edge).z == corners[(t.part + 1) % 3] && leads_off_edge(edge, t.normal);
  }
  uint corner = corners[t.part - 4];
  return own_triangle_of(corner) == second && first < corner && leads_off_vertex(corner, t.normal) &&
         leads_off_vertex(first, -t.normal);
}
