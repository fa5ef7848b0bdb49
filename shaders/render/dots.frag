uniform vec3 colour;
uniform float size;
uniform float hole;  // part of the radius that is open
layout(location = 0) out vec4 result;

void main() {
  float from_edge = (1.0 - 2.0 * distance(gl_PointCoord, vec2(0.5))) * 0.5 * size;  // pixels
  float cover = clamp(from_edge + 0.25, 0.0, 1.0);
  if (hole > 0.0) cover *= clamp((1.0 - hole) * 0.5 * size - from_edge + 1.25, 0.0, 1.0);
  if (cover == 0.0) discard;
  result = vec4(mix(vec3(1.0), colour, smoothstep(0.8, 1.8, from_edge)), cover);
}
