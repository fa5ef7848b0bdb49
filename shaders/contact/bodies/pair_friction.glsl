// The friction coefficient of a pair, by a vertex of each part.
#include "contact/friction.glsl"
#if BODY_FRICTION
float friction_between(uint a, uint b) { return mean_friction(body_friction(a), body_friction(b)); }
#else  // with a mean of equal values the compiler would round what follows differently
float friction_between(uint a, uint b) { return params.friction; }
#endif
