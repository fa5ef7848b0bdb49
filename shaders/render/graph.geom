// An edge of the constraint graph.
layout(lines) in;
layout(line_strip, max_vertices = 2) out;
#include "render/faces.glsl"

void main() {
  if (!finite(corner[0].position) || !finite(corner[1].position)) return;
  for (int i = 0; i < 2; ++i) {
    gl_ClipDistance[0] = view.cut.w - dot(view.cut.xyz, corner[i].rest.xyz);
    emit(vec3(1.0), corner[i].position, vec3(0.0), shown_value(i),
         view.palette[int(corner[0].rest.w) % PALETTE_SIZE].rgb);
  }
  EndPrimitive();
}
