// Contact of a vertex with the obstacles of a step, by number (method.md, "Contact and friction"). The first are planes
// in the step's block; then come SOLIDS others, whose records hold their state at the end of a substep.
#include "contact/plane.glsl"
#include "contact/body_surfaces.glsl"
float plane_distance(DoubleSingle x, vec4 plane) { return (dot(plane.xyz, x.high) - plane.w) + dot(plane.xyz, x.low); }
Surface plane_surface(int k, DoubleSingle x) {
  return Surface(params.planes[k].xyz, plane_distance(x, params.planes[k]));
}

#if SOLIDS
layout(std140, binding = BIND_OBSTACLES) uniform ObstacleBlock {
  vec4 reaches[SOLIDS];  // centre, and how far from there contact is possible within four substeps of its motion
  ObstacleRecord solids[SOLIDS];
};
#if FIELDS
layout(binding = UNIT_FIELDS) uniform samplerBuffer fields;
real texel(int i) { return texelFetch(fields, i).r; }
#else
real texel(int i) { return 0.0; }
#endif
#include "contact/solid.glsl"
#include "contact/obstacles/*.glsl"
// OBSTACLE_KINDS(ROW) is ROW(number, NAME_surface) for each kind among these obstacles.
#define RETURN_SURFACE(number, kind_surface) if (s.kind == number) return kind_surface(s, p);
Surface surface_of(Solid s, vec3 p) {
  OBSTACLE_KINDS(RETURN_SURFACE)
  return Surface(vec3(0.0), 1e9);
}
#include "contact/find_contact.glsl"

vec3 arm_from_solid(int k, DoubleSingle x) { return (x.high - solids[k].centre) + (x.low - solids[k].centre_low); }
vec3 into_solid(int k, vec3 v) { return vec3(dot(solids[k].right, v), dot(solids[k].up, v), dot(solids[k].front, v)); }
vec3 solid_velocity(int k, DoubleSingle x) { return solids[k].velocity + cross(solids[k].spin, arm_from_solid(k, x)); }
Solid solid_at(int k) {
  return Solid(solids[k].kind, solids[k].convex, solids[k].extent, solids[k].radius, solids[k].trust,
               solids[k].spacing, solids[k].origin, solids[k].cells, solids[k].first);
}
// Whether a vertex at the start or the end of a displacement of length `moved` may touch solid k.
bool is_near_solid(int k, DoubleSingle x, float moved) {
  vec3 arm = x.high - reaches[k].xyz;
  float most = reaches[k].w + 2.0 * moved;
  return dot(arm, arm) <= most * most;
}
float solid_friction(int k, uint i) { return solids[k].friction < 0.0 ? body_friction(i) : solids[k].friction; }
float solid_restitution(int k, uint i) {
  return solids[k].restitution < 0.0 ? body_restitution(i) : solids[k].restitution;
}
float solid_distance(int k, DoubleSingle x) {
  return surface_of(solid_at(k), into_solid(k, arm_from_solid(k, x))).distance;
}
// The contact plane of a vertex that came to x by a displacement relative to solid k, and the distance of x from it.
Surface solid_contact(int k, DoubleSingle x, vec3 displacement) {
  vec3 to = into_solid(k, arm_from_solid(k, x));
  Surface s = find_contact(solid_at(k), to - into_solid(k, displacement), to);
  return Surface(s.normal.x * solids[k].right + s.normal.y * solids[k].up + s.normal.z * solids[k].front, s.distance);
}
#else  // never called
bool is_near_solid(int k, DoubleSingle x, float moved) { return false; }
vec3 solid_velocity(int k, DoubleSingle x) { return vec3(0.0); }
float solid_friction(int k, uint i) { return 0.0; }
float solid_restitution(int k, uint i) { return 0.0; }
float solid_distance(int k, DoubleSingle x) { return 0.0; }
Surface solid_contact(int k, DoubleSingle x, vec3 displacement) { return Surface(vec3(0.0), 0.0); }
#endif
// A bit for each solid that a vertex moving by so much to or from x may touch: a loop over bits is 7 % faster than one
// over solids that tests each.
uint near_solids(DoubleSingle x, float moved) {
  uint bits = 0u;
  for (int k = 0; k < SOLIDS; ++k) bits |= is_near_solid(k, x, moved) ? 1u << k : 0u;
  return bits;
}

int obstacle_count() { return params.plane_count + SOLIDS; }
bool is_solid(int k) { return SOLIDS > 0 && k >= params.plane_count; }
// Of vertex i on an obstacle.
float obstacle_friction(int k, uint i) {
  return is_solid(k) ? solid_friction(k - params.plane_count, i) : body_friction(i);
}
float obstacle_restitution(int k, uint i) {
  return is_solid(k) ? solid_restitution(k - params.plane_count, i) : body_restitution(i);
}
// m/s, of the obstacle's material at x.
vec3 obstacle_velocity(int k, DoubleSingle x) {
  return is_solid(k) ? solid_velocity(k - params.plane_count, x) : vec3(0.0);
}
// The signed distance of x.
float obstacle_distance(int k, DoubleSingle x) {
  return is_solid(k) ? solid_distance(k - params.plane_count, x) : plane_distance(x, params.planes[k]);
}
// The contact plane of a vertex that sets out from x by `aim`, and the distance of x + u from it; none far away.
Surface surface_ahead(int k, DoubleSingle x, vec3 aim, vec3 u) {
#if SOLIDS  // even a branch that is never taken would change how compilers round what follows
  int s = k - params.plane_count;
  if (s >= 0) {
    if (!is_near_solid(s, x, length(aim))) return Surface(vec3(0.0), 1e9);
    Surface contact = solid_contact(s, add_double(x, aim), aim - params.h * solid_velocity(s, x));
    return Surface(contact.normal, contact.distance + dot(contact.normal, u - aim));
  }
#endif
  Surface plane = plane_surface(k, x);
  return Surface(plane.normal, plane.distance + dot(plane.normal, u));
}
// The contact plane of a vertex that leaves x with this velocity for a substep, and the distance of x itself from it.
Surface surface_before(int k, DoubleSingle x, vec3 velocity) {
#if SOLIDS
  int s = k - params.plane_count;
  if (s >= 0) {
    vec3 speed = solid_velocity(s, x), displacement = params.h * (velocity - speed);
    Surface contact = solid_contact(s, add_double(x, params.h * speed + displacement), displacement);
    return Surface(contact.normal, contact.distance - dot(contact.normal, displacement));
  }
#endif
  return plane_surface(k, x);
}
bool is_in_plane(DoubleSingle x) {
  bool any = params.plane_count > 0 && plane_distance(x, params.planes[0]) < 0.0;  // most scenes have no second one
  for (int k = 1; k < params.plane_count; ++k) any = any || plane_distance(x, params.planes[k]) < 0.0;
  return any;
}
// Whether a vertex may be stopped at x, from wherever or after a displacement of length `moved`.
bool may_touch(DoubleSingle x) { return SOLIDS > 0 || is_in_plane(x); }
bool may_touch(DoubleSingle x, float moved) { return near_solids(x, moved) != 0u || is_in_plane(x); }
// Whether a vertex that moves from x to `next` in a substep is stopped.
bool will_touch(DoubleSingle x, DoubleSingle next) {
  vec3 move = relative(next, x);
  bool any = is_in_plane(next);
  for (int k = 0; k < SOLIDS && !any; ++k) {
    if (!is_near_solid(k, x, length(move))) continue;
    vec3 displacement = move - params.h * solid_velocity(k, x);
    any = solid_contact(k, add_double(x, displacement), displacement).distance < 0.0;
  }
  return any;
}
#if MOVING_SOLIDS
float along_obstacles = 0.0;  // m^2/s, of the corrections of this invocation's vertex along the velocities of obstacles
#endif
// Moves vertex i at x out of all obstacles in turn; `moved`: its displacement in this substep so far.
DoubleSingle resolve_contacts(uint i, DoubleSingle x, vec3 moved) {
  for (int k = 0; k < params.plane_count; ++k) {
    Surface plane = plane_surface(k, x);
    if (plane.distance < 0.0) {
      vec3 correction = plane_correction(plane.normal, plane.distance, moved, body_friction(i));
      x = add_double(x, correction);
      moved += correction;
    }
  }
  for (uint left = near_solids(x, length(moved)); left != 0u;) {
    int k = findLSB(left);
    left &= left - 1u;
    vec3 displacement = moved - params.h * solid_velocity(k, x);
    Surface contact = solid_contact(k, x, displacement);
    if (contact.distance < 0.0) {
      vec3 correction = plane_correction(contact.normal, contact.distance, displacement, solid_friction(k, i));
#if MOVING_SOLIDS
      along_obstacles += dot(correction, solid_velocity(k, x));
#endif
      x = add_double(x, correction);
      moved += correction;
      left = near_solids(x, length(moved)) & ~((2u << k) - 1u);
    }
  }
  return x;
}
