// The friction coefficient and the restitution of a vertex's body.
#ifndef SURFACES_OF_BODIES
#define SURFACES_OF_BODIES
#if BODY_SURFACES
layout(binding = UNIT_SURFACES) uniform samplerBuffer vertex_surfaces;  // two values by vertex
float body_friction(uint i) { return texelFetch(vertex_surfaces, int(2u * i)).r; }
float body_restitution(uint i) { return texelFetch(vertex_surfaces, int(2u * i + 1u)).r; }
#else
float body_friction(uint i) { return params.friction; }
float body_restitution(uint i) { return params.restitution; }
#endif
#endif
