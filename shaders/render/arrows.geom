// Draws an arrow as a shaft and a head, whose width is in pixels.
layout(points) in;
layout(triangle_strip, max_vertices = 7) out;
uniform vec3 viewport;  // pixels; z unused
uniform float width;
in Arrow {
  vec4 from, to;
  vec3 colour;
} arrow[];
out vec3 colour;

void put(vec4 at, vec2 pixels) {
  colour = arrow[0].colour;
  gl_Position = at + vec4(2.0 * pixels / viewport.xy * at.w, 0.0, 0.0);
  EmitVertex();
}

void main() {
  vec4 a = arrow[0].from, b = arrow[0].to;
  if (a.w < 1e-4 || b.w < 1e-4) return;
  vec2 shaft = (b.xy / b.w - a.xy / a.w) * 0.5 * viewport.xy;  // pixels
  float size = length(shaft);
  if (size < 1.0) return;
  vec2 along = shaft / size, across = vec2(-along.y, along.x) * width;
  float head = min(7.0 * width, 0.6 * size);
  vec4 neck = vec4(mix(a, b, (size - head) / size));
  put(a, 0.5 * across);
  put(a, -0.5 * across);
  put(neck, 0.5 * across);
  put(neck, -0.5 * across);
  EndPrimitive();
  put(neck, 0.36 * head / width * across);
  put(neck, -0.36 * head / width * across);
  put(b, vec2(0.0));
  EndPrimitive();
}
