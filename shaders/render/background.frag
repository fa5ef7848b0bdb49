in float height;
layout(location = 0) out vec4 result;
void main() {
  const vec3 low = vec3(0.815, 0.810, 0.800), high = vec3(0.620, 0.670, 0.720);
  result = vec4(mix(low, high, smoothstep(0.0, 1.0, height)), 1.0);
}
