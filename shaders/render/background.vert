// One triangle over the whole viewport.
out float height;
void main() {
  vec2 p = vec2(float(gl_VertexID & 1), float(gl_VertexID >> 1)) * 4.0 - 1.0;
  height = p.y * 0.5 + 0.5;
  gl_Position = vec4(p, 1.0, 1.0);
}
