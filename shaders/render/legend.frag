#include "render/view.glsl"
#include "render/colour.glsl"
layout(binding = UNIT_GLYPHS) uniform sampler2D glyphs;
uniform vec4 panel;  // centre and half size, pixels
in vec2 pixel;
in vec3 where;
in vec4 tint;
layout(location = 0) out vec4 result;

void main() {
  int kind = int(where.z + 0.5);
  result = tint;
  if (kind == 0) result.a *= texture(glyphs, where.xy).r;
  if (kind == 2) result.rgb = scale_colour(int(view.colour.x), mix(view.colour.y, view.colour.z, where.y), view.colour.y, view.colour.z);
  if (kind == 3) {
    const float radius = 8.0;
    vec2 q = abs(pixel - panel.xy) - panel.zw + radius;
    float outside = length(max(q, vec2(0.0))) + min(max(q.x, q.y), 0.0) - radius;
    result.a *= clamp(0.5 - outside, 0.0, 1.0);
  }
}
