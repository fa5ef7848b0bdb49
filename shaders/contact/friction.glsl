// The friction coefficient of a vertex's body.
#ifndef FRICTION_OF_BODIES
#define FRICTION_OF_BODIES
#if BODY_FRICTION
layout(binding = UNIT_FRICTION) uniform samplerBuffer vertex_friction;  // negative: the world's
float body_friction(uint i) {
  float own = texelFetch(vertex_friction, int(i)).r;
  return own < 0.0 ? params.friction : own;
}
#else
float body_friction(uint i) { return params.friction; }
#endif
#endif
