// Ground or wall: a grid with lines every 0.1 m and 1 m that fades into the background, and the bodies' shadow.
#include "render/view.glsl"
#include "render/light.glsl"
uniform vec4 plane;
uniform vec3 centre;
uniform float extent;
uniform float opacity;
uniform float grid;  // strength of the lines
in vec3 position;
in vec2 across;
layout(location = 0) out vec4 result;

// Cover of the nearest lines, gone before they come closer than about three pixels.
float lines(vec2 p, float spacing, float width) {
  vec2 q = p / spacing, pixel = fwidth(q);
  vec2 away = abs(fract(q - 0.5) - 0.5) / max(pixel, vec2(1e-12));
  vec2 cover = (1.0 - smoothstep(width * 0.5 - 0.5, width * 0.5 + 0.5, away)) * (1.0 - smoothstep(0.06, 0.35, pixel));
  return max(cover.x, cover.y);
}

void main() {
  vec3 middle = centre - plane.xyz * (dot(plane.xyz, centre) - plane.w);
  float fade = 1.0 - smoothstep(0.25, 1.0, distance(position, middle) / extent);
  bool behind = dot(plane.xyz, view.eye.xyz) < plane.w;
  vec3 albedo = vec3(0.700, 0.700, 0.695);
  albedo *= 1.0 - grid * max(0.10 * lines(across, 0.1, 1.0), 0.26 * lines(across, 1.0, 1.5));
  float lit = behind ? 1.0 : plane_shadow(position);
  vec3 colour = albedo * mix(vec3(0.575, 0.585, 0.605), vec3(1.06), lit);
  result = vec4(colour, fade * opacity);
}
