// The ground or a wall, with a grid of lines every 0.1 m and 1 m and the bodies' shadow, fading into the background.
#include "render/view.glsl"
#include "render/light.glsl"
uniform int plane;
uniform vec3 centre;
uniform float extent;
uniform float opacity;  // 1: the ground, which hides the background and draws it itself where it fades
uniform float grid;     // opacity of the lines
in vec3 position;
in vec2 across;
layout(location = 0) out vec4 result;

// The part of a pixel that the nearest lines cover. They fade before they are closer than about three pixels.
float lines(vec2 p, vec2 pixel, float width) {
  vec2 away = abs(fract(p - 0.5) - 0.5) / max(pixel, vec2(1e-12));
  vec2 cover = clamp(width * 0.5 + 0.5 - away, 0.0, 1.0) * (1.0 - smoothstep(0.06, 0.35, pixel));
  return max(cover.x, cover.y);
}

void main() {
  vec4 n = view.planes[plane];
  bool wall = float(plane) >= view.scene.y;
  vec3 middle = centre - n.xyz * (dot(n.xyz, centre) - n.w);
  float fade = 1.0 - smoothstep(wall ? 0.75 : 0.25, 1.0, distance(position, middle) / extent);
  vec2 pixel = fwidth(across);
  float line = grid * max(0.10 * lines(across * 10.0, pixel * 10.0, 1.0), 0.26 * lines(across, pixel, 1.5));
  vec3 albedo = wall ? vec3(0.46, 0.55, 0.63) : vec3(0.70, 0.70, 0.695);
  vec2 light = dot(n.xyz, view.eye.xyz) < n.w ? vec2(1.0) : arriving(position, float(plane));
  vec3 received =
      key_colour * max(dot(n.xyz, key_direction), 0.0) * light.x + surroundings(0.5 + 0.5 * n.y, vec2(1.0)) * light.y;
  vec3 colour = albedo * (1.0 - line) * received;
  result = opacity == 1.0 ? vec4(mix(background_colour(gl_FragCoord.y), colour, fade), 1.0)
                          : vec4(colour, fade * mix(opacity, 1.0, wall ? 2.0 * line : 0.0));
}
