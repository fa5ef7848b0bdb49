// Accelerations of vertices by loads (method.md, "Loads"), where the substep begins. One invocation per vertex.
#include "types.glsl"
#include "double_single.glsl"
layout(local_size_x = 128) in;
layout(std430) readonly buffer Positions { Position positions[]; };
layout(std430) readonly buffer Velocities { Velocity velocities[]; };
layout(std430) restrict readonly buffer LoadRecords { LoadRecord load_records[]; };
// By vertex: bits of the loads on it, where its faces begin and end; then of each face the two vertices that follow
// this one, and bits of the loads on the face.
layout(std430) restrict readonly buffer LoadMesh { uvec4 load_mesh[]; };
layout(std430) restrict writeonly buffer Loads { vec4 accelerations[]; };
uniform uint load_count, times;  // how many times there are records of: of implicit steps the end and the middle

vec3 velocity(uint i) { return velocities[i].high + velocities[i].low; }
vec3 acceleration(uint i, uint first) {
  uvec4 own = load_mesh[i];
  vec3 pull = vec3(0.0), force = vec3(0.0), blown = vec3(0.0);
  float rate = 0.0;  // kg/s, by which wind resists the vertex
  for (uint k = 0u; k < load_count; ++k)
    if ((own.x & (1u << k)) != 0u && load_records[first + k].kind == LOAD_ACCELERATION)
      pull += load_records[first + k].vector;
  for (uint f = own.y; f < own.z; ++f) {
    uvec4 face = load_mesh[f];
    vec3 a = relative(positions[face.x], positions[i]), b = relative(positions[face.y], positions[i]);
    vec3 third = cross(a, b) / 6.0;
    float area = length(third);
    for (uint bits = face.z; bits != 0u; bits &= bits - 1u) {
      LoadRecord load = load_records[first + uint(findLSB(bits))];
      if (load.kind == LOAD_PRESSURE) force += load.amount * third;
      if (load.kind != LOAD_WIND || !(area > 0.0)) continue;
      vec3 normal = third / area;
      vec3 past = load.vector - (velocity(i) + velocity(face.x) + velocity(face.y)) / 3.0;
      float across = dot(past, normal), resists = 0.5 * load.amount * abs(across) * area;
      blown += resists * across * normal;
      rate += resists;
    }
  }
  float w = positions[i].inverse_mass;
  return pull + force * w + blown * (w / (1.0 + params.h * rate * w));
}
void main() {
  uint i = gl_GlobalInvocationID.x;
  if (i >= params.vertex_count) return;
  for (uint t = 0u; t < times; ++t)
    accelerations[t * params.vertex_count + i] = vec4(acceleration(i, t * load_count), 0.0);
}
