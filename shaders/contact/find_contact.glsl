// The plane that a point meets on its straight way `from`, `to`, and the distance of `to` from it: negative where it
// would be stopped. Where it meets nothing, that of the nearest point of the surface (method.md, "Obstacles with a
// shape"). GLSL and C++ (sim/model/formulas.h); surface_of(): the distance of the solid's kind.
// Convex solids lie behind the plane at their nearest point, so the search goes from plane to plane (Newton's
// method): each plane makes distance times approach at least four times smaller, so it takes a dozen turns. Others are
// searched in steps of the distance, half a cell at least, however long the way is: few lead up to their field, and
// there are turns enough to cross it.
Surface find_contact(Solid s, vec3 from, vec3 to) {
  vec3 way = to - from;
  real l = length(way), least = s.spacing > real(0) ? real(0.5) * s.spacing : l / real(64);
  real close = real(1e-3) * l + real(4) * rounding * length(from), t = real(0);
  bool convex = s.convex != 0, hit = false, on = true;
  Surface here = Surface(vec3(real(0)), real(0)), end = here, plane = here;
  // The start, the end, then the way between: one call of the distance, whose code is long.
  for (int turn = 0; turn < 66 + 2 * (s.cells.x + s.cells.y + s.cells.z) && on; ++turn) {
    Surface found = surface_of(s, turn == 1 ? to : from + t * way);
    if (turn == 1) end = found;
    else here = found;
    if (turn == 0) {
      on = here.distance * s.trust <= l;
      end = Surface(here.normal, here.distance + dot(here.normal, way));
    } else {
      if (here.distance <= (convex ? close : real(0))) {
        plane = Surface(here.normal, here.distance + dot(here.normal, way) * (real(1) - t));
        hit = plane.distance < real(0);
        on = !hit && !convex;
      }
      real approach = -dot(here.normal, way);
      on = on && l > real(0) && (!convex || approach > real(0));
      if (on) t += convex ? here.distance / approach : max(here.distance * s.trust, least) / l;
      on = on && t < real(1);
    }
  }
  // Inside, the nearest point is better known than a plane, but only on the same side.
  if (hit && !(end.distance < real(0) && dot(end.normal, plane.normal) > real(0.5))) return plane;
  return end;
}
