// One triangle over the whole viewport, behind everything.
void main() {
  vec2 p = vec2(float(gl_VertexID & 1), float(gl_VertexID >> 1)) * 4.0 - 1.0;
  gl_Position = vec4(p, 1.0, 1.0);
}
