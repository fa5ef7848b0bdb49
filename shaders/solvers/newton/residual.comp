// The residual at Newton's start, the inverse diagonal blocks, and which obstacles hold a vertex. LANES invocations per
// vertex.
#include "solvers/newton/newton.glsl"
shared vec3 parts[3][GROUP_SIZE];

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
    mat3 D = mat3(diagonal.x + aim.w, across.x, across.y, across.x, diagonal.y + aim.w, across.z, across.y, across.z,
                  diagonal.z + aim.w);
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
  if (i < VERTICES) {
    uint end = first_neighbour[i + 1u];
    for (uint k = first_neighbour[i] + lane % LANES; k < end; k += LANES) {
      uint edge = neighbours[k].x, e = edge >> 1;
      vec4 c0 = blocks[e].columns[0], c1 = blocks[e].columns[1], c2 = blocks[e].columns[2];
      vec3 f = vec3(c0.w, c1.w, c2.w);
      force += (edge & 1u) == 0u ? f : -f;
      diagonal -= vec3(c0.x, c1.y, c2.z);
      across -= 0.5 * vec3(c0.y + c1.x, c0.z + c2.x, c1.z + c2.y);
    }
  }
  parts[0][lane] = force;
  parts[1][lane] = diagonal;
  parts[2][lane] = across;
  barrier();
  if (lane % LANES != 0u || i >= VERTICES) return;
  for (uint k = 1u; k < LANES; ++k) {
    force += parts[0][lane + k];
    diagonal += parts[1][lane + k];
    across += parts[2][lane + k];
  }
  finish(i, force, diagonal, across);
}
