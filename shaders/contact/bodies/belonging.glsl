// Which pairs count, by the surfaces of bodies where the substep began.
#include "contact/bodies/surfaces.glsl"
vec3 between(uint from, uint to) {
  Position a = positions[from], b = positions[to];
  return relative(b, a) - (way_of(to) - way_of(from));
}
uvec4 edge_vertices(uint e) { return edges[e]; }
uvec4 triangle_corners(uint t) { return triangles[t]; }
uint edge_of_triangle(uint t, int side) { return triangle_edges[3u * t + uint(side)]; }
uint own_triangle_of(uint vertex) { return own_triangle[vertex]; }
uint first_neighbour_of(uint vertex) { return first_neighbour[vertex]; }
uint neighbour_at(uint k) { return neighbours[k]; }
#include "contact/bodies/belongs.glsl"
