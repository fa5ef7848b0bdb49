// A tet as it is shown, for geometry shaders that get its four corners.
#include "render/values.glsl"
#include "render/material.glsl"

// The body's colour, where tets are drawn apart a little lighter or darker for each, to tell neighbours apart.
vec3 tone() {
  uint hash = uint(gl_PrimitiveIDIn) * 2654435761u;
  float shade = view.tets.z > 0.0 ? 0.88 + 0.24 * float(hash >> 16) / 65535.0 : 0.9;
  return view.palette[int(corner[0].rest.w) % PALETTE_SIZE].rgb * shade;
}

// Finds its corners as shrink_tet() moves them, and their values; false if one is not finite.
bool place_tet(out vec3 p[4], out float value[4]) {
  vec3 r[4];
  for (int i = 0; i < 4; ++i) {
    p[i] = corner[i].position;
    r[i] = corner[i].rest.xyz;
    value[i] = shown_value(i);
    if (!finite(p[i])) return false;
  }
  int kind = int(view.colour.x);
  vec4 material = body_material(corner[0].rest.w);
  bool averaged = material.z == 3.0 && (kind == COLOUR_VOLUME || kind == COLOUR_ENERGY);  // of smoothed tets
  bool by_tet = kind == COLOUR_VOLUME || kind == COLOUR_STRETCH || kind == COLOUR_ENERGY || kind == COLOUR_RESIDUAL;
  if (by_tet && !averaged) {
    // The exact value of the tet replaces means by vertex, which the surface shows.
    float own = tet_value(kind, p, r, material);
    for (int i = 0; i < 4; ++i) value[i] = own;
  }
  shrink_tet(p);
  return true;
}
