// A tetrahedron as four faces, shrunk towards its centre, or nothing when it is cut away or not finite. The cut is by
// the rest shape, so that a moving tetrahedron does not flicker through it.
layout(lines_adjacency) in;
layout(triangle_strip, max_vertices = 12) out;
#include "render/faces.glsl"

float volume(vec3 a, vec3 b, vec3 c, vec3 d) { return dot(cross(b - a, c - a), d - a) / 6.0; }

// One value for the whole tetrahedron, exact where the surface view shows means over a vertex.
float tet_value(vec3 p[4]) {
  int kind = int(view.colour.x);
  if (kind == COLOUR_VOLUME)
    return volume(p[0], p[1], p[2], p[3]) /
               volume(corner[0].rest.xyz, corner[1].rest.xyz, corner[2].rest.xyz, corner[3].rest.xyz) - 1.0;
  if (kind == COLOUR_STRETCH) {
    float sum = 0.0;
    for (int i = 0; i < 4; ++i)
      for (int j = i + 1; j < 4; ++j)
        sum += distance(p[i], p[j]) / distance(corner[i].rest.xyz, corner[j].rest.xyz) - 1.0;
    return sum / 6.0;
  }
  return 0.25 * (corner[0].value + corner[1].value + corner[2].value + corner[3].value);
}

void main() {
  vec3 p[4] = vec3[](corner[0].position, corner[1].position, corner[2].position, corner[3].position);
  for (int i = 0; i < 4; ++i)
    if (!finite(p[i])) return;
  vec3 rest = 0.25 * (corner[0].rest.xyz + corner[1].rest.xyz + corner[2].rest.xyz + corner[3].rest.xyz);
  int axis = int(view.tets.w);
  float along = (rest[axis] - view.rest_low[axis]) / max(view.rest_high[axis] - view.rest_low[axis], 1e-30);
  if (view.tets.z < 1.0 && along > view.tets.z) return;

  float value = tet_value(p);
  vec3 centre = 0.25 * (p[0] + p[1] + p[2] + p[3]);
  vec3 moved = centre + (view.tets.y > 0.0 ? view.tets.y * (centre - light.centre.xyz) : vec3(0.0));
  for (int i = 0; i < 4; ++i) p[i] = moved + (p[i] - centre) * (1.0 - view.tets.x);
  // A little lighter or darker each, to tell neighbours apart.
  uint hash = uint(gl_PrimitiveIDIn) * 2654435761u;
  float tone = 0.88 + 0.24 * float(hash >> 16) / 65535.0;
  vec3 albedo = view.palette[int(corner[0].rest.w) % PALETTE_SIZE].rgb * tone;

  const ivec3 faces[4] = ivec3[](ivec3(0, 2, 1), ivec3(0, 1, 3), ivec3(0, 3, 2), ivec3(1, 2, 3));
  for (int f = 0; f < 4; ++f) {
    vec3 area = cross(p[faces[f].y] - p[faces[f].x], p[faces[f].z] - p[faces[f].x]);
    vec3 normal = area / max(length(area), 1e-30);
    for (int i = 0; i < 3; ++i) emit(i, p[faces[f][i]], normal, value, albedo);
    EndPrimitive();
  }
}
