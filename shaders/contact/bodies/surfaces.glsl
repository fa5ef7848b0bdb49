// Surfaces of bodies. Parts have the numbers that they have on the CPU (sim/contact/surfaces.h). Of several arrays in a
// block all but the last need a size.
#include "contact/bodies/layout.glsl"
layout(std430) restrict readonly buffer PairMesh {
  uvec4 triangles[TRIANGLES];  // corners; 0
  uvec4 edges[EDGES];          // ends; the third corners of the triangles beside it, or NONE
  vec4 places[PLACES];         // by vertex where the run starts, then at rest where bodies touch themselves
  uint triangle_edges[3u * TRIANGLES];
  uint own_triangle[VERTICES];  // one of those around each vertex
  float offsets[VERTICES];      // m
  uint first_neighbour[VERTICES + 1u];
  uint neighbours[2u * EDGES];
  uint leaf_triangles[TRIANGLES];  // in the order of leaves
  uint leaf_vertices[SURFACE_VERTICES];
  uint leaf_edges[EDGES];
  SurfaceLeaf leaves[LEAVES];
};
uvec4 candidate_vertices(uvec2 candidate) {
  uint first = candidate.x & ~OF_EDGES, second = candidate.y & ~SAME_BODY;
  if ((candidate.x & OF_EDGES) != 0u) return uvec4(edges[first].xy, edges[second].xy);
  return uvec4(first, triangles[second].xyz);
}
