// What mode newton keeps of each vertex, VERTICES of each slot.
#define AIM 0      // where inertia carries it, from its place; mass / h^2 (0: fixed)
#define OFFSET 1   // z of BDF2 from its place; h
#define WAY 2      // of the last step; bits: a step is known, obstacles touched
#define GAIN 3     // of velocity in the last step; the force of obstacles, N
#define RESIDUAL 4 // r; bits of obstacles that hold it
#define SEARCH 5   // z = M^-1 r
#define DIRECTION 6   // p
#define IMAGE 7    // q = A p
#define STEP 8     // s, of Newton
#define INVERSE 9  // of A's 3x3 block: xx, xy, xz, yy
#define INVERSE2 10  // yz, zz; resistance to sliding, N/m; with it of obstacles, bits
#define PRODUCT 11 // A z
#define REST 12    // place; 1 + number among free bodies, or 0
#define KNOWN 0x80000000u
layout(std430, binding = BIND_NEWTON_VECTORS) restrict buffer Vectors { vec4 vectors[]; };
vec4 at(uint slot, uint i) { return vectors[slot * VERTICES + i]; }
void put(uint slot, uint i, vec3 v, float w) { vectors[slot * VERTICES + i] = vec4(v, w); }
