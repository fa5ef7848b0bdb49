// Vertex Block Descent (method.md eqs. 40-41): the vertices of one colour, of which no two share a constraint, each go
// to the minimum of a quadratic model of their own energy, while all others stay. LANES invocations per vertex, whose
// sums are added in a fixed order. Positions are read in full: forces by quantized ones would not answer a motion of
// less than a quantum, which left a beam in 40 substeps a step with 17 times the error.
#define WITHOUT_CHECK
#include "types.glsl"
#include "double_single.glsl"
#include "quantize.glsl"
layout(std430) restrict readonly buffer Quantized { ivec4 quantized[]; };  // of the substep's start, for damping
#include "vertex_state.glsl"
#include "contact/obstacles.glsl"
layout(local_size_x = GROUP_SIZE) in;
#include "solvers/newton/layout.glsl"
// In a block of several arrays all but the last need a size, which may not be 0.
layout(std430) restrict readonly buffer Mesh {
  uint members[VERTICES];         // vertices, colour after colour
  uint first_use[VERTICES + 1u];  // by member, and the end
  uint uses[max(USES, 1u)];       // PACKED_USE, of which j is not used
  // Each kind of constraint has vertices, rest values, a material's compliances, and a body's own damping.
  #foreach uvec$ARITY vertices_$KIND[max(COUNT_$KIND, 1u)];
  #foreach float values_$KIND[max($VALUESu * COUNT_$KIND, 1u)];
  #foreach float compliances_$KIND[max($MATERIALu * $COMPONENTSu * COUNT_$KIND, 1u)];
  #foreach float dampings_$KIND[max($OWNu * COUNT_$KIND, 1u)];
};
uniform uvec2 colour;  // its first member, and the end
#define Ids uvec4      // of the vertices
uint id_of(Ids ids, int j) { return ids[j]; }
// Without apply_dead_zone(): forces do not magnify rounding as hard constraints do, and one that jumps at the edge of
// a dead zone keeps sweeps from converging, which gave a damped beam in 40 substeps a step 5 times the error.
#define rounding 0.0
#include "constraints/types.glsl"
#foreach #include "constraints/$KIND.glsl"
#foreach #include "solvers/newton/rest.glsl"
#foreach #include "solvers/vbd/corner.glsl"
#include "solvers/guards.glsl"

void descend(uint i, Position own, mat3 block, vec3 gradient) {
  DoubleSingle x = DoubleSingle(own.high, own.low);
  Velocity predicted = velocities[params.vertex_count + i];
  vec3 from = relative(x, DoubleSingle(predicted.high, predicted.low));
  float inertia = params.inverse_h * params.inverse_h / own.inverse_mass;
  vec3 force = -inertia * from - gradient;
  for (int c = 0; c < 3; ++c) block[c][c] += inertia;
  vec3 rows = abs(block[0]) + abs(block[1]) + abs(block[2]);
  float stiffest = max(rows.x, max(rows.y, rows.z));  // bounds the eigenvalues, and keeps the inverse in range
  for (int c = 0; c < 3; ++c) block[c] /= stiffest;
  vec3 correction = limited(inverse(block) * (force / stiffest)), moved = params.h * velocities[i].high + from;
  DoubleSingle there = add_double(x, correction);
  if (may_touch(there, length(moved + correction))) {
    DoubleSingle free = there;
    there = resolve_contacts(i, free, moved + correction);
    if (relative(there, free) != vec3(0.0)) {
      // The block would turn a push along the normal into motion along the surface. With a single stiffness for all
      // directions, a correction by contact times that stiffness is the obstacle's force, and friction keeps to
      // Coulomb's limit.
      correction = limited(force / stiffest);
#if MOVING_SOLIDS
      along_obstacles = 0.0;
#endif
      there = resolve_contacts(i, add_double(x, correction), moved + correction);
#if MOVING_SOLIDS
      if ((phases & PHASE_FINISH) != 0u) velocities[i].work += along_obstacles * stiffest * params.h;
#endif
    }
  }
  positions[i] = Position(there.high, own.inverse_mass, there.low, own.constraints);
}

shared vec3 parts[4][GROUP_SIZE];
void main() {
  uint lane = gl_LocalInvocationIndex, member = colour.x + group_index() * (GROUP_SIZE / LANES) + lane / LANES;
  bool exists = member < colour.y;
  uint i = members[exists ? member : 0u];
  Position own = positions[i];
  exists = exists && own.inverse_mass > 0.0;
  mat3 block = mat3(0.0);
  vec3 gradient = vec3(0.0);
  if (exists) {
    begin_body(i);
    for (uint k = first_use[member] + lane % LANES; k < first_use[member + 1u]; k += LANES) {
      uint use = uses[k], kind = USE_KIND(use), c = USE_CONSTRAINT(use);
      int corner = USE_I(use);
      #foreach if (kind == $INDEXu) add_$KIND(c, corner, own, block, gradient);
    }
  }
  for (int c = 0; c < 3; ++c) parts[c][lane] = block[c];
  parts[3][lane] = gradient;
  barrier();
  if (!exists || lane % LANES != 0u) return;
  for (uint k = 1u; k < LANES; ++k) {
    for (int c = 0; c < 3; ++c) block[c] += parts[c][lane + k];
    gradient += parts[3][lane + k];
  }
  descend(i, own, block, gradient);
}
