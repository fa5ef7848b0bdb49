// Fixed-point sums of what contact does to vertices, in SUM_PARTS of a quantum, so that their order changes no bit.
#define SUM_PARTS 64.0
ivec3 to_quanta(vec3 change) {
  float most = 0.2 * params.body_size;
  return ivec3(round(clamp(change, -most, most) * (params.inverse_quantum * SUM_PARTS)));
}
vec3 in_metres(int x, int y, int z) { return vec3(x, y, z) * (params.quantum / SUM_PARTS); }
