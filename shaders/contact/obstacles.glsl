// A vertex and the obstacles of a step, by number (method.md, "Contact and friction"). First come half spaces at
// rest, of which their planes in the step's block say all; then SOLIDS others, whose records are of the end of a
// substep. A displacement relative to an obstacle is less by how far obstacle_velocity() comes in a substep.
#include "contact/plane.glsl"
#include "contact/friction.glsl"
float depth_of(DoubleSingle x, vec4 plane) { return (dot(plane.xyz, x.high) - plane.w) + dot(plane.xyz, x.low); }
Surface plane_surface(int k, DoubleSingle x) { return Surface(params.planes[k].xyz, depth_of(x, params.planes[k])); }

#if SOLIDS
layout(std140, binding = BIND_OBSTACLES) uniform ObstacleBlock {
  vec4 reaches[SOLIDS];  // centres, and how far from there one is met within four substeps, by what it carries along
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
// OBSTACLE_KINDS(ROW): ROW(number, NAME_surface) for the kinds of this step.
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
// Whether `times` the displacement relative to solid k, of a vertex that itself moves by `moved`, may meet it, of
// either end.
bool is_near_solid(int k, DoubleSingle x, float moved, float times) {
  vec3 arm = x.high - reaches[k].xyz;
  float most = reaches[k].w + 2.0 * times * moved;
  return dot(arm, arm) <= most * most;
}
// A bit for each solid that a vertex may meet that moves by so much to or from x: a loop over bits is 7 % faster than
// one that asks for the next solid again and again.
uint near_solids(DoubleSingle x, float moved) {
  uint bits = 0u;
  for (int k = 0; k < SOLIDS; ++k) bits |= is_near_solid(k, x, moved, 1.0) ? 1u << k : 0u;
  return bits;
}
float solid_friction(int k, uint i) {
  return BODY_FRICTION == 0 || solids[k].own_friction == 1 ? solids[k].friction : body_friction(i);
}
Surface solid_met(int k, DoubleSingle x, vec3 way) {
  vec3 to = into_solid(k, arm_from_solid(k, x));
  Surface s = find_contact(solid_at(k), to - into_solid(k, way), to);
  return Surface(s.normal.x * solids[k].right + s.normal.y * solids[k].up + s.normal.z * solids[k].front, s.distance);
}
#endif

int obstacle_count() { return params.plane_count + SOLIDS; }
// Of vertex i on an obstacle.
float obstacle_friction(int k, uint i) {
#if SOLIDS
  if (k >= params.plane_count) return solid_friction(k - params.plane_count, i);
#endif
  return body_friction(i);
}
float obstacle_restitution(int k) {
#if SOLIDS
  if (k >= params.plane_count) return solids[k - params.plane_count].restitution;
#endif
  return params.restitution;
}
// m/s, of the obstacle's matter where x is.
vec3 obstacle_velocity(int k, DoubleSingle x) {
#if SOLIDS
  if (k >= params.plane_count) return solid_velocity(k - params.plane_count, x);
#endif
  return vec3(0.0);
}
// The signed distance of x.
float obstacle_distance(int k, DoubleSingle x) {
#if SOLIDS
  int s = k - params.plane_count;
  if (s >= 0) return surface_of(solid_at(s), into_solid(s, arm_from_solid(s, x))).distance;
#endif
  return depth_of(x, params.planes[k]);
}
// The plane that a vertex at x meets which sets out by `aim`; the distance is that of x + u. Far away: no plane.
Surface surface_ahead(int k, DoubleSingle x, vec3 aim, vec3 u) {
#if SOLIDS
  int s = k - params.plane_count;
  if (s >= 0) {
    if (!is_near_solid(s, x, length(aim), 1.0)) return Surface(vec3(0.0), 1e9);
    Surface met = solid_met(s, add_double(x, aim), aim - params.h * solid_velocity(s, x));
    return Surface(met.normal, met.distance + dot(met.normal, u - aim));
  }
#endif
  Surface plane = plane_surface(k, x);
  return Surface(plane.normal, plane.distance + dot(plane.normal, u));
}
// The plane that a vertex at x meets in a substep at this velocity; the distance is that of x itself.
Surface surface_before(int k, DoubleSingle x, vec3 velocity) {
#if SOLIDS
  int s = k - params.plane_count;
  if (s >= 0) {
    vec3 speed = solid_velocity(s, x), way = params.h * (velocity - speed);
    Surface met = solid_met(s, add_double(x, params.h * speed + way), way);
    return Surface(met.normal, met.distance - dot(met.normal, way));
  }
#endif
  return plane_surface(k, x);
}
bool is_in_plane(DoubleSingle x) {
  bool any = params.plane_count > 0 && depth_of(x, params.planes[0]) < 0.0;  // mostly there is one, or none
  for (int k = 1; k < params.plane_count; ++k) any = any || depth_of(x, params.planes[k]) < 0.0;
  return any;
}
// Whether a vertex at x may be stopped, wherever it came from; and one that came by so much.
bool may_touch(DoubleSingle x) { return SOLIDS > 0 || is_in_plane(x); }
bool may_touch(DoubleSingle x, float moved) {
#if SOLIDS
  if (near_solids(x, moved) != 0u) return true;
#endif
  return is_in_plane(x);
}
// Whether a vertex at x that will be at `next` in a substep is stopped within so many of them, at the speed of now.
bool will_touch(DoubleSingle x, DoubleSingle next, float substeps) {
  vec3 way = relative(next, x);
  if (substeps != 1.0) next = add_double(next, (substeps - 1.0) * way);
  bool any = is_in_plane(next);
#if SOLIDS
  for (int k = 0; k < SOLIDS && !any; ++k) {
    if (!is_near_solid(k, x, length(way), substeps)) continue;
    vec3 relative_way = substeps * (way - params.h * solid_velocity(k, x));
    any = solid_met(k, add_double(x, relative_way), relative_way).distance < 0.0;
  }
#endif
  return any;
}
// Vertex i at x, moved out of all obstacles in turn; `moved`: its displacement in this substep so far.
DoubleSingle resolve_contacts(uint i, DoubleSingle x, vec3 moved) {
  for (int k = 0; k < params.plane_count; ++k) {
    Surface plane = plane_surface(k, x);
    if (plane.distance < 0.0) {
      vec3 correction = plane_correction(plane.normal, plane.distance, moved, body_friction(i));
      x = add_double(x, correction);
      moved += correction;
    }
  }
#if SOLIDS
  for (uint left = near_solids(x, length(moved)); left != 0u;) {
    int k = findLSB(left);
    left &= left - 1u;
    vec3 way = moved - params.h * solid_velocity(k, x);
    Surface met = solid_met(k, x, way);
    if (met.distance < 0.0) {
      vec3 correction = plane_correction(met.normal, met.distance, way, solid_friction(k, i));
      x = add_double(x, correction);
      moved += correction;
      left = near_solids(x, length(moved)) & ~((2u << k) - 1u);
    }
  }
#endif
  return x;
}
