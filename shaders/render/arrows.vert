// A vertex with where its velocity takes it in `seconds`.
#include "render/view.glsl"
layout(location = ATTRIBUTE_HIGH) in vec3 high;
layout(location = ATTRIBUTE_LOW) in vec3 low;
layout(location = ATTRIBUTE_REST) in vec4 rest;
layout(location = ATTRIBUTE_VELOCITY) in vec3 velocity;
uniform float seconds;
out Arrow {
  vec4 from, to;  // clip space; from.w 0: none
} arrow;

void main() {
  vec3 a = high + low, b = a + seconds * velocity;
  bool shown = finite(a) && finite(b) && dot(view.cut.xyz, rest.xyz) <= view.cut.w;
  arrow.from = shown ? view.camera * vec4(mix(a, view.eye.xyz, 0.004), 1.0) : vec4(0.0);
  arrow.to = view.camera * vec4(mix(b, view.eye.xyz, 0.004), 1.0);
}
