// The energy of an attachment or a fibre.
#define Ids uint
uint id_of(Ids ids, int j) { return 0u; }
#include "constraints/types.glsl"
#include "constraints/attach.glsl"
#include "constraints/fibre.glsl"
layout(std430) readonly buffer Positions { Position positions[]; };
layout(std430) buffer Velocities { Velocity velocities[]; };
layout(std430) readonly buffer Held { HeldRecord held[]; };
uniform uint count;
// J, of record k where its vertices were `age` seconds ago.
float held_energy(uint k, float age, float activation) {
  vec3 x[4];
  float rest[5];
  uint first = held[k].vertices[0];
  for (int v = 0; v < 5; ++v) rest[v] = held[k].rest[v];
  for (int j = 0; j < 4; ++j) {
    uint i = held[k].vertices[j];
    x[j] = relative(positions[i], positions[first]) - age * (velocities[i].high - velocities[first].high);
  }
  rest[3] -= activation;
  float C = held[k].is_fibre != 0u ? fibre(x, rest, 0u).C : attach(x, rest, 0u).C;
  return 0.5 * held[k].stiffness * C * C;
}
uint fibres_of(uint k) { return uint(held[k].rest[4]); }
