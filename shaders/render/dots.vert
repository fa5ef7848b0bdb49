// A marked vertex as a dot of fixed size on the screen, slightly in front of the surface.
#include "render/view.glsl"
layout(location = ATTRIBUTE_HIGH) in vec3 high;
layout(location = ATTRIBUTE_LOW) in vec3 low;
layout(location = ATTRIBUTE_REST) in vec4 rest;
uniform float size;  // pixels
#ifdef CONTACTS
uniform float touching;  // m, the distance to a plane that counts as contact
bool is_marked(vec3 p) {
  for (int i = 0; i < int(view.scene.x); ++i)
    if (dot(view.planes[i].xyz, p) - view.planes[i].w <= touching) return true;
  return false;
}
#else
bool is_marked(vec3 p) { return true; }
#endif

void main() {
  vec3 p = high + low;
  if (!finite(p) || !is_marked(p) || dot(view.cut.xyz, rest.xyz) > view.cut.w) {
    gl_Position = vec4(2.0, 2.0, 2.0, 1.0);  // outside the viewport
    gl_PointSize = 1.0;
    return;
  }
  gl_Position = view.camera * vec4(mix(p, view.eye.xyz, 0.01), 1.0);
  gl_PointSize = size;
}
