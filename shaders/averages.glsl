// Averages of F and J around a vertex, for kernels that say by ring_side() where a neighbour is from there.
#include "rings.glsl"
vec3 ring_side(uint j);
// Adds V F and V J as every `lanes`-th neighbour and part from `lane` on has them.
void add_averages(Ring ring, uint lane, uint lanes, inout mat3 F, inout float J) {
  for (uint k = ring.first_neighbour + 2u * lane; k < ring.end_neighbour; k += 2u * lanes) {
    uvec4 own = rings[k];
    F += outerProduct(ring_side(own.w), uintBitsToFloat(own.xyz));
  }
  for (uint k = ring.first_part + lane; k < ring.end_part; k += lanes) {
    uvec4 part = rings[k];
    J += uintBitsToFloat(part.w) * dot(ring_side(part.x), cross(ring_side(part.y), ring_side(part.z)));
  }
}
