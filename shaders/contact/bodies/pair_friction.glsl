// The friction coefficient and the restitution of a pair, by a vertex of each part.
#include "contact/body_surfaces.glsl"
#if BODY_SURFACES
float friction_between(uint a, uint b) { return mean_of_surfaces(body_friction(a), body_friction(b)); }
float restitution_between(uint a, uint b) { return mean_of_surfaces(body_restitution(a), body_restitution(b)); }
#else  // with a mean of equal values the compiler would round what follows differently
float friction_between(uint a, uint b) { return params.friction; }
float restitution_between(uint a, uint b) { return params.restitution; }
#endif
