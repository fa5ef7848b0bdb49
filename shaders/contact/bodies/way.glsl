// How far a vertex came in this substep, m.
#define WITHOUT_CHECK
#ifdef MEETS
#define WITHOUT_VELOCITIES
#endif
#include "vertex_state.glsl"
#if BEFORE_SUBSTEP
vec3 way_of(uint i) { return vec3(0.0); }
#elif defined(MEETS)
#include "solvers/newton/words.glsl"
vec3 way_of(uint i) { return at(AIM, i).w > 0.0 ? vec3(0.0) : at(AIM, i).xyz; }
#elif IMPLICIT
#include "solvers/newton/layout.glsl"
layout(std430) restrict buffer Vectors { vec4 vectors[]; };  // by slot, then vertex
vec3 way_of(uint i) { return vectors[OFFSET * VERTICES + i].xyz; }
#else
// Forces and corrections leave the velocity with which a vertex came from where it was.
vec3 way_of(uint i) { return params.h * velocities[i].high; }
#endif
