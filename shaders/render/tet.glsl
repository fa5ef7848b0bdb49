// A tetrahedron as it is shown: of geometry shaders with its four corners.
#include "render/values.glsl"

// A little lighter or darker each, to tell neighbours apart, where they are drawn apart.
vec3 tone() {
  uint hash = uint(gl_PrimitiveIDIn) * 2654435761u;
  float shade = view.tets.z > 0.0 ? 0.88 + 0.24 * float(hash >> 16) / 65535.0 : 0.9;
  return view.palette[int(corner[0].rest.w) % PALETTE_SIZE].rgb * shade;
}

// Its corners, shrunk towards its centre and moved from that of the bodies, and their values; false if one is not
// finite.
bool place_tet(out vec3 p[4], out float value[4]) {
  vec3 r[4];
  for (int i = 0; i < 4; ++i) {
    p[i] = corner[i].position;
    r[i] = corner[i].rest.xyz;
    value[i] = shown_value(i);
    if (!finite(p[i])) return false;
  }
  int kind = int(view.colour.x);
  if (kind == COLOUR_VOLUME || kind == COLOUR_STRETCH || kind == COLOUR_ENERGY || kind == COLOUR_RESIDUAL) {
    // One for the whole tetrahedron, exact where the surface shows means over a vertex.
    float own = tet_value(kind, p, r, view.material);
    for (int i = 0; i < 4; ++i) value[i] = own;
  }
  shrink_tet(p);
  return true;
}
