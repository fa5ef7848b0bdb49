// One work-group adds the last partial sums into the row.
#include "measure/reduce.glsl"
void main() {
  int me = int(gl_LocalInvocationIndex);
  if (me >= M_ANGULAR && me <= M_RIGID_SQUARES) row[me] = total(me);
}
