// The inputs of kernels that gather by vertex: positions, rest positions, and the items of each vertex.
layout(local_size_x = 128) in;
layout(std430) readonly buffer Positions { Position positions[]; };
layout(std430) readonly buffer Rest { vec4 rest[]; };
layout(std430) readonly buffer Offsets { uint offsets[]; };
layout(std430) readonly buffer Items { uint items[]; };  // the other corners of elements
uniform uint count;
vec3 position(uint v) { return positions[v].high + positions[v].low; }
