// The contact plane of a point that moves straight `from`, `to`, and the distance of `to` from it, negative if it would
// be stopped; else the plane at the nearest point of the surface (method.md, "Obstacles with a shape"). GLSL and C++
// (sim/model/formulas.h), where surface_of() is the signed distance of the solid's kind.
Surface find_contact(Solid s, vec3 from, vec3 to) {
  vec3 path = to - from;
  real l = length(path), least = s.spacing > real(0) ? real(0.5) * s.spacing : l / real(64);
  real close = real(1e-3) * l + real(4) * rounding * length(from), t = real(0);
  bool convex = s.convex != 0, hit = false, on = true;
  Surface here = Surface(vec3(real(0)), real(0)), end = here, plane = here;
  // Newton's method goes from plane to plane of a convex solid, which lies behind each of them: in every turn distance
  // times approach falls to a quarter or less, so a dozen turns suffice. Others are searched in steps of the distance,
  // at least half a cell; few of them lead up to their field, and there are turns enough to cross it.
  for (int turn = 0; turn < 66 + 2 * (s.cells.x + s.cells.y + s.cells.z) && on; ++turn) {
    // The start, the end, then points between share one call, because the code of distances is long.
    Surface found = surface_of(s, turn == 1 ? to : from + t * path);
    if (turn == 1) end = found;
    else here = found;
    if (turn == 0) {
      on = here.distance * s.trust <= l;
      end = Surface(here.normal, here.distance + dot(here.normal, path));
    } else {
      if (here.distance <= (convex ? close : real(0))) {
        plane = Surface(here.normal, here.distance + dot(here.normal, path) * (real(1) - t));
        hit = plane.distance < real(0);
        on = !hit && !convex;
      }
      real approach = -dot(here.normal, path);
      on = on && l > real(0) && (!convex || approach > real(0));
      if (on) t += convex ? here.distance / approach : max(here.distance * s.trust, least) / l;
      on = on && t < real(1);
    }
  }
  // Inside, the plane at the end's nearest point is more exact, but only if that is on the same side.
  if (hit && !(end.distance < real(0) && dot(end.normal, plane.normal) > real(0.5))) return plane;
  return end;
}
