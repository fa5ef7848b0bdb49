// The residual at Newton's start, the inverse diagonal blocks, and which obstacles hold a vertex. LANES invocations per
// vertex.
#define WITHOUT_VELOCITIES
#include "solvers/newton/newton.glsl"
#if AVERAGED
#include "solvers/newton/smoothing.glsl"
// Adds the diagonal block by which an average resists a vertex with such gradients of V F and V lambda J.
void add_resistance(Ring ring, mat3 F, vec3 gradient, vec3 slope, inout vec3 diagonal, inout vec3 across) {
  float I = squares(F) + 1.0, shear = ring.shear * ring.inverse_volume, bulk = ring.inverse_volume / ring.bulk;
  vec3 along = F * gradient;
  float turn = 2.0 * shear / (I * I);
  diagonal += vec3(shear * (1.0 - 1.0 / I) * dot(gradient, gradient)) + turn * along * along + bulk * slope * slope;
  across += turn * vec3(along.x * along.y, along.x * along.z, along.y * along.z) +
            bulk * vec3(slope.x * slope.y, slope.x * slope.z, slope.y * slope.z);
}
#endif
shared vec3 parts[3][GROUP_SIZE];
#if AVERAGED
shared vec3 own_parts[2][GROUP_SIZE];
#endif

void finish(uint i, vec3 force, vec3 diagonal, vec3 across) {
  Position own = positions[i];
  DoubleSingle x = DoubleSingle(own.high, own.low);
  vec4 aim = at(AIM, i);
  vec3 r = vec3(0.0);
  uint holds = 0u, touched = touched_before(i);
  float slides = 0.0;
  vec3 left = at(LEFT, i).xyz, friction = vec3(0.0), slip = vec3(0.0);
  vec3 inverse_diagonal = vec3(0.0), inverse_across = vec3(0.0);
  if (aim.w > 0.0) {
    vec3 u = start_displacement(i, x);
    r = -force - aim.w * (u - aim.xyz);
#if TOUCHING
    put(OWN, i, diagonal + aim.w, 0.0), put(OWN2, i, across, at(OWN2, i).w);
    r += taken_press(i);
#endif
    mat3 D = mat3(diagonal.x + aim.w, across.x, across.y, across.x, diagonal.y + aim.w, across.z, across.y, across.z,
                  diagonal.z + aim.w);
#if TOUCHING
    D += pressed_block(i, BLOCK, BLOCK2);
#endif
    float limit = friction_limit(i, touched);
    if (limit > 0.0) {
      slides = grip * aim.w;
      friction = free_part(left, touched, i) - slides * slid_by(i, x, u, touched);
      float force = length(friction);
      if (force > limit) {
        friction *= limit / force;
        // A stiff body starts where it will be, so that what slips meets the whole limit. Otherwise the solution moves
        // a vertex against its friction yet, which therefore has to fall with that.
        bool stiff = began_stiff(i) && round_of_newton() == 0u;
        slides *= limit / force;
        if (stiff) slip = friction / limit;
        left = stiff ? friction + slides * without(slid_by(i, x, u, touched), slip) : left * (limit / force);
      }
      r += friction;
      for (int c = 0; c < 3; ++c) D[c] += without(free_part(mat3(slides)[c], touched, i), slip);
    }
    for (int k = 0; k < obstacle_count(); ++k) {
      Surface plane = surface_ahead(k, x, aimed(i), u);
      // A rigid start moves a vertex out, and a turn may take it a little too far.
      float moved_out = max(0.0, dot(plane.normal, u - aim.xyz));
      bool there = plane.distance <= 2.0 * FINE_AT(params.quantum, i) + 0.1 * moved_out;
      if (there && (dot(plane.normal, r) <= 0.0 || (touched & (1u << k)) != 0u)) holds |= 1u << k;
    }
    mat3 B = inverse(D);
    inverse_diagonal = vec3(B[0][0], B[1][1], B[2][2]);
    inverse_across = vec3(B[0][1], B[0][2], B[1][2]);
  }
  put(RESIDUAL, i, r, 0.0);
  put(FRICTION, i, left, uintBitsToFloat(holds));
  put(DIRECTION, i, vec3(0.0), slip.x);
  put(IMAGE, i, vec3(0.0), slip.y);
  put(STEP, i, vec3(0.0), slip.z);
  put(INVERSE, i, inverse_diagonal, slides);
  put(INVERSE2, i, inverse_across, uintBitsToFloat(touched));
}

void main() {
  uint lane = gl_LocalInvocationIndex, row = lane / LANES, i = group_index() * (GROUP_SIZE / LANES) + row;
  vec3 force = vec3(0.0), diagonal = vec3(0.0), across = vec3(0.0);
#if AVERAGED
  vec3 own_gradient = vec3(0.0), own_slope = vec3(0.0);
  Ring ring = ring_of(min(i, VERTICES - 1u));
  mat3 F = MATRIX_OF(averages, min(i, VERTICES - 1u)), stress = shear_stress(F) * ring.shear;
#endif
  if (i < VERTICES) {
    uint first = first_neighbour[i], end = first_neighbour[i + 1u];
    for (uint k = first + lane % LANES; k < end; k += LANES) {
      uint edge = neighbours[k].x, e = edge >> 1;
      vec4 c0 = blocks[e].columns[0], c1 = blocks[e].columns[1], c2 = blocks[e].columns[2];
      vec3 f = vec3(c0.w, c1.w, c2.w);
      force += (edge & 1u) == 0u ? f : -f;
      diagonal -= vec3(c0.x, c1.y, c2.z);
      across -= 0.5 * vec3(c0.y + c1.x, c0.z + c2.x, c1.z + c2.y);
#if AVERAGED
      if (!(ring.inverse_volume > 0.0)) continue;
      RingNeighbour n = ring_neighbour(ring.first_neighbour + 2u * (k - first));
      Ring other = ring_of(n.vertex);
      mat3 of_other = MATRIX_OF(averages, n.vertex);
      force += shear_stress(of_other) * n.other * other.shear - stress * n.own;
      add_resistance(other, of_other, n.other, slopes[edge ^ 1u].xyz, diagonal, across);
      own_gradient -= n.own;
      own_slope -= slopes[edge].xyz;
#endif
    }
  }
  parts[0][lane] = force;
  parts[1][lane] = diagonal;
  parts[2][lane] = across;
#if AVERAGED
  own_parts[0][lane] = own_gradient;
  own_parts[1][lane] = own_slope;
#endif
  barrier();
  if (lane % LANES != 0u || i >= VERTICES) return;
  for (uint k = 1u; k < LANES; ++k) {
    force += parts[0][lane + k];
    diagonal += parts[1][lane + k];
    across += parts[2][lane + k];
#if AVERAGED
    own_gradient += own_parts[0][lane + k];
    own_slope += own_parts[1][lane + k];
#endif
  }
#if AVERAGED
  if (ring.inverse_volume > 0.0) add_resistance(ring, F, own_gradient, own_slope, diagonal, across);
#endif
  finish(i, force, diagonal, across);
}
