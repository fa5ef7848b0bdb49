// Text and rectangles in pixels from the top left.
#include "render/view.glsl"
layout(location = 0) in vec2 position;
layout(location = 1) in vec3 coordinates;  // z: 0 glyph, 1 plain, 2 colour bar, 3 rounded panel
layout(location = 2) in vec4 colour;
out vec2 pixel;
out vec3 where;
out vec4 tint;

void main() {
  pixel = position;
  where = coordinates;
  tint = colour;
  gl_Position = vec4(position / view.pixels.xy * vec2(2.0, -2.0) + vec2(-1.0, 1.0), 0.0, 1.0);
}
