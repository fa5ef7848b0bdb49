// What kernels read of patches (sim/solvers/patches.h): headers of chunks, their vertices, their records.
layout(std430) restrict readonly buffer Patches { uvec2 patch_words[]; };
// The first word of a record has a byte for each vertex: its number in the chunk.
uint local_id(uint record, int j) { return (record >> (8 * j)) & 255u; }
// The words of a record are its vertices, rest values, a material's compliances, and a body's own k and damping.
float record_value(uint number, uint word) {
  return uintBitsToFloat(patch_words[RECORDS_AT + number + word / 2u][word % 2u]);
}
// A patch is one chunk, or more where its vertices are too many for one; those it owns come first in each.
struct Chunk {
  uint number;
  uint vertices;
  uint owned;
  uint first;  // global id of its first vertex
  uint next;   // chunk of the patch; 0: none
};
Chunk chunk_at(uint number) {
  uvec2 counts = patch_words[CHUNK_PAIRS * number], links = patch_words[CHUNK_PAIRS * number + 1];
  return Chunk(number, counts.x, counts.y, links.x, links.y);
}
