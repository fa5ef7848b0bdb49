// The paper's constraint-centric kernel as published (algorithm 3), the baseline of `bench`: one kind per dispatch, one
// invocation per constraint. GL 4.3 adds no floats atomically, so sums are made by compare-and-swap on their bits, in
// whatever order invocations arrive: the last bits differ from run to run.
#include "types.glsl"
#include "double_single.glsl"
#include "quantized.glsl"
layout(local_size_x = GROUP_SIZE) in;
layout(std430) buffer Sums { uint correction_sums[]; };
layout(std430) restrict readonly buffer Records { Record$ARITY records[]; };
#define Ids uint  // the record's number
uint id_of(Ids record, int j) { return records[record].vertices[j]; }
#include "constraints/types.glsl"
#include "constraints/$KIND.glsl"

void add(uint at, float value) {
  uint expected = correction_sums[at], found;
  while ((found = atomicCompSwap(correction_sums[at], expected, floatBitsToUint(uintBitsToFloat(expected) + value))) !=
         expected)
    expected = found;
}

void main() {
  uint index = group_index() * GROUP_SIZE + gl_LocalInvocationIndex;
  if (index >= COUNT) return;
  Record$ARITY record = records[index];
  begin_body(record.vertices[0]);
  vec3 x[$ARITY];
  float w[$ARITY];
  ivec4 first = quantized[record.vertices[0]];
  for (int j = 0; j < $ARITY; ++j) {
    ivec4 q = quantized[record.vertices[j]];
    x[j] = between(q, first);
    w[j] = inverse_mass_of(q);
  }
  Constraint$ARITY c = $KIND(x, record.rest, index);
  float k = params.stiffness[$KIND_ROW][$KIND_COLUMN],
        lambda = multiplier(c, w, k, FINE(params.max_correction), 0.0, 1.0).lambda;
  if (lambda == 0.0) return;
  for (int j = 0; j < $ARITY; ++j) {
    vec3 correction = lambda * w[j] * c.gradient[j];
    for (int a = 0; a < 3; ++a)
      if (correction[a] != 0.0) add(4u * record.vertices[j] + uint(a), correction[a]);
  }
}
