// Whether a pair counts: of all pairs that see each other in the same direction one does. GLSL and C++
// (sim/contact/offset_contact.h), which give between(), from one vertex to another where the substep begins, and the
// surface: corners of triangles, edges with the third corners beside them, neighbours of vertices.
bool leads_off_edge(uint edge, vec3 to) {
  uvec4 e = edge_vertices(edge);
  vec3 along = between(e.x, e.y);
  for (int side = 0; side < 2; ++side) {
    uint beside = side == 0 ? e.z : e.w;
    if (beside == NONE) continue;
    vec3 across = between(e.x, beside);
    if (!leads_away(to, across - along * (dot(across, along) / dot(along, along)))) return false;
  }
  return true;
}
bool leads_off_vertex(uint vertex, vec3 to) {
  for (uint k = first_neighbour_of(vertex); k < first_neighbour_of(vertex + 1u); ++k)
    if (!leads_away(to, between(vertex, neighbour_at(k)))) return false;
  return true;
}
bool belongs(Proximity t, bool edges, uint first, uint second) {
  if (edges) return t.part == 0 && leads_off_edge(first, -t.normal) && leads_off_edge(second, t.normal);
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
