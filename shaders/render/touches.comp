// Makes an arrow for each vertex or sharp edge that is in another body, along the normal by which it leaves, with its
// depth (below 0: no arrow). There is an invocation for each record of contact.
#include "layout.glsl"
#include "render/layout.glsl"
#define real float
#include "contact/bodies/formulas.glsl"
layout(local_size_x = 128) in;
layout(std430) readonly buffer Positions { Position positions[]; };
#include "contact/bodies/surfaces.glsl"
layout(std430) writeonly buffer Arrows { ContactArrow arrows[]; };
vec3 place(uint vertex) { return positions[vertex].high; }
void main() {
  uint record = gl_WorkGroupID.y * gl_NumWorkGroups.x * 128u + gl_GlobalInvocationID.x;
  if (record >= ITEMS) return;
  uint t = record < counts.records ? records[record].target : NONE, s = records[record].item;
  arrows[record] = ContactArrow(vec3(0.0), -1.0, vec3(0.0), 0.0);
  if (t == NONE) return;
  bool under = (t & UNDER) != 0u;
  t &= TARGET;
  vec3 x, n;
  float depth;
  if (s >= SURFACE_VERTICES) {
    uvec4 own = edge_vertices[s - SURFACE_VERTICES], other = edge_vertices[t - TRIANGLES];
    vec3 p = place(own.x), q = place(own.y), a = place(other.x), b = place(other.y);
    n = cross(q - p, b - a);
    float outwards = dot(n, edge_normal(b - a, place(other.z) - a, place(other.w) - a));
    n *= outwards < 0.0 ? -1.0 : 1.0;
    x = 0.5 * (p + q);
    depth = dot(a - p, n) / max(length(n), 1e-30);
  } else {
    uvec4 corners = triangles[t];
    x = place(surface_vertices[s].x);
    vec3 a = place(corners.x) - x;
    n = cross(place(corners.y) - x - a, place(corners.z) - x - a) * (under ? -1.0 : 1.0);
    depth = dot(a, n) / max(length(n), 1e-30);
  }
  if (length(n) > 0.0) arrows[record] = ContactArrow(x, max(depth, 0.0), normalize(n), 0.0);
}
