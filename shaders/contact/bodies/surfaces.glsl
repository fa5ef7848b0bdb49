// Surfaces of bodies, and the contacts found between them. An item is a vertex of a surface or, numbered behind these,
// a sharp edge; its targets are triangles or, numbered behind these, edges. Of several arrays in a block all but the
// last need a size, which must not be 0.
#include "contact/bodies/layout.glsl"
#define ITEMS (SURFACE_VERTICES + EDGES)
layout(std430) restrict readonly buffer PairMesh {
  uvec4 triangles[TRIANGLES];           // vertices; body
  uvec4 edge_vertices[max(EDGES, 1u)];  // sharp ones of solids: ends; third vertices of the triangles beside them
  uint edge_bodies[max(EDGES, 1u)];
  uvec2 surface_vertices[SURFACE_VERTICES];  // vertex; body
  uint first_around[SURFACE_VERTICES + 1u];  // by surface vertex
  uvec2 around[3u * TRIANGLES];              // the other two vertices of a triangle around it, in order
  SurfaceLeaf leaves[LEAVES];
  SurfaceBody bodies[BODY_COUNT + 1];
  SurfaceSlice slices[SLICES];
  uint behind[TRIANGLES];             // the tet behind each triangle, or NONE
  uvec4 tet_vertices[max(TETS, 1u)];  // of those near the surface
  uvec4 tet_beyond[max(TETS, 1u)];    // the tets across from these, or NONE
};
#define PER_GROUP (GROUP_SIZE / LANES)
layout(std430) restrict buffer PairLists {
  ContactTotals totals;
  CandidateCounts counts;
  BodyBox boxes[BODY_COUNT];
  uint held_by[ITEMS];  // the target that each item was in last, with its bits, or NONE
  float depths[ITEMS];  // m, how deep
  // Items of leaves that are near another body, each leaf in work-groups of its own that are filled with NONE; then the
  // leaf of each work-group.
  uint near_vertices[SURFACE_VERTICES + LEAVES * PER_GROUP];
  uint near_edges[EDGES + LEAVES * PER_GROUP];
  uint leaf_of_group[SURFACE_VERTICES / PER_GROUP + LEAVES];
  uint leaf_of_edge_group[EDGES / PER_GROUP + LEAVES];
  LeafBox leaf_boxes[LEAVES];
  NearLeaves near_leaves[LEAVES];
  ContactRecord records[];
};
