// An arrow from a vertex along its displacement in `seconds`. With CONTACTS `velocity` is the normal at a contact, and
// the colour shows its depth.
#include "render/view.glsl"
layout(location = ATTRIBUTE_HIGH) in vec3 high;
layout(location = ATTRIBUTE_LOW) in vec3 low;
layout(location = ATTRIBUTE_REST) in vec4 rest;
layout(location = ATTRIBUTE_VELOCITY) in vec3 velocity;
uniform float seconds;
#ifdef CONTACTS
layout(location = ATTRIBUTE_VALUE) in float depth;  // m; below 0: no contact
uniform float deepest;                              // m; from here on arrows are red
#endif
out Arrow {
  vec4 from, to;  // clip space; from.w 0: no arrow
  vec3 colour;
} arrow;

void main() {
  vec3 a = high + low, b = a + seconds * velocity;
  bool shown = finite(a) && finite(b) && dot(view.cut.xyz, rest.xyz) <= view.cut.w;
  arrow.colour = vec3(0.02, 0.025, 0.04);
#ifdef CONTACTS
  shown = shown && depth >= 0.0;
  arrow.colour = mix(vec3(0.95, 0.62, 0.05), vec3(0.75, 0.0, 0.08), clamp(depth / deepest, 0.0, 1.0));
#endif
  arrow.from = shown ? view.camera * vec4(mix(a, view.eye.xyz, 0.004), 1.0) : vec4(0.0);
  arrow.to = view.camera * vec4(mix(b, view.eye.xyz, 0.004), 1.0);
}
