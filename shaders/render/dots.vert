// A marked vertex as a dot of fixed size on the screen, drawn slightly in front of its surface.
#include "render/view.glsl"
layout(location = ATTRIBUTE_HIGH) in vec3 high;
layout(location = ATTRIBUTE_LOW) in vec3 low;
layout(location = ATTRIBUTE_REST) in vec4 rest;
uniform float size;  // pixels

void main() {
  vec3 p = high + low;
  if (!finite(p) || dot(view.cut.xyz, rest.xyz) > view.cut.w) {
    gl_Position = vec4(2.0, 2.0, 2.0, 1.0);  // outside
    gl_PointSize = 1.0;
    return;
  }
  gl_Position = view.camera * vec4(mix(p, view.eye.xyz, 0.01), 1.0);
  gl_PointSize = size;
}
