// What accelerates a vertex before constraints do, m/s^2: gravity, and what loads.comp found.
#if LOADED
layout(binding = UNIT_LOADS) uniform samplerBuffer loads;
vec3 load_on(uint i) { return texelFetch(loads, int(i)).xyz; }
vec3 pull_on(uint i) { return params.gravity + load_on(i); }
// J, of loads on a vertex that moves by `moved`. Implicit steps, which take loads at their end, find those of their
// middle behind them.
float work_of_loads(uint i, vec3 moved, float inverse_mass) { return dot(load_on(i), moved) / inverse_mass; }
float work_of_loads_midway(uint i, vec3 moved, float inverse_mass) {
  return work_of_loads(params.vertex_count + i, moved, 1.0) / inverse_mass;
}
#else
vec3 pull_on(uint i) { return params.gravity; }
#endif
