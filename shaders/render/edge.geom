// Draws an edge as a band whose width is in pixels.
layout(lines) in;
layout(triangle_strip, max_vertices = 4) out;
#include "render/view.glsl"
uniform vec3 viewport;  // pixels; z unused
uniform vec3 shade;
uniform float width;
in Corner {
  vec3 position;
  float value;
  vec4 rest;
} corner[];
out vec3 colour;

void put(vec4 at, vec2 pixels) {
  colour = shade;
  gl_Position = at + vec4(2.0 * pixels / viewport.xy * at.w, 0.0, 0.0);
  EmitVertex();
}

void main() {
  if (!finite(corner[0].position) || !finite(corner[1].position)) return;
  vec4 a = view.camera * vec4(corner[0].position, 1.0), b = view.camera * vec4(corner[1].position, 1.0);
  if (a.w < 1e-4 || b.w < 1e-4) return;
  vec2 along = (b.xy / b.w - a.xy / a.w) * viewport.xy;
  vec2 unit = length(along) > 1e-3 ? normalize(along) : vec2(1.0, 0.0);
  vec2 end = 0.5 * width * unit, across = vec2(-end.y, end.x);
  put(a, across - end);
  put(a, -across - end);
  put(b, across + end);
  put(b, -across + end);
  EndPrimitive();
}
