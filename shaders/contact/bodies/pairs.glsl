// Pairs of surfaces that may touch, and what they do to vertices (method.md, "Bodies in contact").
#include "contact/bodies/lists.glsl"
layout(std430) restrict buffer Pairs { SurfacePair pairs[]; };
#ifndef MEETS
layout(std430) restrict buffer PairSumsByVertex { PairSums pair_sums[]; };
#endif
#include "contact/bodies/way.glsl"
#include "contact/bodies/proximity.glsl"
#include "contact/sums.glsl"

// A pair's vertices where the substep began, from the first; their ways in it, m; their inverse masses, 1/kg.
struct PairState {
  uvec4 vertices;
  vec3 places[4], ways[4];
  float weights[4];
  bool turns;  // all can move
};
PairState state_of(uvec4 vertices) {
  PairState s;
  s.vertices = vertices;
  s.turns = true;
  Position first;
  for (int k = 0; k < 4; ++k) {
    Position own = positions[vertices[k]];
    if (k == 0) first = own;
    s.ways[k] = way_of(vertices[k]);
    s.weights[k] = own.inverse_mass;
    s.turns = s.turns && own.inverse_mass > 0.0;
    s.places[k] = relative(own, first) - (s.ways[k] - s.ways[0]);
  }
  return s;
}
Proximity proximity_of(vec3 places[4], bool of_edges) {
  if (of_edges) return edge_edge_proximity(places[1], places[2], places[3]);
  return vertex_triangle_proximity(places[1], places[2], places[3]);
}
uint packed_shares(Proximity t) {
  uint shares = 0u;
  for (int k = 0; k < 4; ++k) shares |= mass_share(t, k) << (8 * k);
  return shares;
}
uint share_of(uint shares, int k) { return (shares >> (8 * k)) & 255u; }
