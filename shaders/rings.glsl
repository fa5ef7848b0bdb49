#ifndef RINGS
#define RINGS
// The neighbours of vertices among smoothed tets, and the tets around each (sim/model/averages.h), in words of four.
// Each vertex has two: V^-1, shear and bulk; where its neighbours, of two words each, and its parts begin and end.
#define MATRIX_OF(columns, i) mat3(columns[3u * (i)].xyz, columns[3u * (i) + 1u].xyz, columns[3u * (i) + 2u].xyz)
layout(std430) restrict readonly buffer Rings { uvec4 rings[]; };
struct Ring {
  float inverse_volume, shear, bulk;  // 0 of a vertex without smoothed tets
  uint first_neighbour, end_neighbour, first_part, end_part;
};
Ring ring_of(uint i) {
  vec4 moduli = uintBitsToFloat(rings[2u * i]);
  uvec4 range = rings[2u * i + 1u];
  return Ring(moduli.x, moduli.y, moduli.z, range.x, range.y, range.z, range.w);
}
// A neighbour, V dF/dx of the vertex by the neighbour's position, and of the neighbour's by its own, m^2.
struct RingNeighbour {
  uint vertex;
  vec3 own, other;
};
RingNeighbour ring_neighbour(uint k) {
  uvec4 own = rings[k];
  return RingNeighbour(own.w, uintBitsToFloat(own.xyz), uintBitsToFloat(rings[k + 1u].xyz));
}
#endif
