// Rigid handles on the GPU (sim/handles.h). A handle has a pose; what its vertices deviate from it, in whole units of places, times
// whole weights, is added up in 64 bits by the patches that move them, and the next dispatch's patches find from that how the pose has
// to change. All sums are exact, and a pull uses the same integers, so momentum stays to rounding of the pulls themselves.
#include "rigid.glsl"
// HANDLE_ROW words of a handle: 12 sums W {1, steps} x deviation, low and high words; the pose they are from, as R and the centre's place.
layout(std430, binding = BIND_HANDLES) restrict readonly buffer Handles { Handle handles[]; };          // of each patch, $HANDLES places
layout(std430, binding = BIND_HANDLE_LISTS) restrict readonly buffer HandleLists { uint lists[]; };  // which these are; ~0: none
layout(std430, binding = BIND_HANDLE_REST) restrict readonly buffer HandleRest { vec4 rest[]; };     // of a vertex: in cells; mass
layout(std430, binding = BIND_HANDLE_SUMS) buffer HandleSums { uint rows[]; };  // three sets: read, added to, cleared, by turns
shared vec4 home[$SUMMED];
// Of each handle of the patch.
struct Held {
  vec3 node, centre, cell;
  float steps_per_metre;
  mat3 R;         // pose of the sums, and where it has the centre
  ivec3 place;
  mat3 turn;      // how R has to change, units a step
  ivec3 move;     // and the place, whole units and the rest
  vec3 move_rest;
};
shared Held held[$HANDLES];
shared uint handle_numbers[$HANDLES];
shared uint held_count;

uint row_of(uint offset, uint handle) { return (((turn.x >> TURN_BITS) + offset) % 3u * $HANDLE_COUNTu + handle) * HANDLE_ROW; }
vec3 floats_of(uint at) { return uintBitsToFloat(uvec3(rows[at], rows[at + 1u], rows[at + 2u])); }
double exact_sum_of(uint row, uint k) { return double(int(rows[row + 2u * k + 1u])) * 4294967296.0LF + double(rows[row + 2u * k]); }
float sum_of(uint row, uint k) {  // by its size: the low word of a small negative number is large
  uint low = rows[row + 2u * k], high = rows[row + 2u * k + 1u];
  bool negative = int(high) < 0;
  if (negative) low = ~low + 1u, high = ~high + (low == 0u ? 1u : 0u);
  float size = float(high) * 4294967296.0 + float(low);
  return negative ? -size : size;
}
vec3 sums_of(uint row, uint k) { return vec3(sum_of(row, k), sum_of(row, k + 1u), sum_of(row, k + 2u)); }
void keep_words(uint at, uvec3 words) {
  rows[at] = words.x;
  rows[at + 1u] = words.y;
  rows[at + 2u] = words.z;
}
mat3 symmetric(vec3 squares, vec3 products) {
  return mat3(squares.x, products.z, products.y, products.z, squares.y, products.x, products.y, products.x, squares.z);
}
// How far a vertex is from where its handle's pose has it, units. Float rounds where the pose has it, to 1e-7 of the arm, always alike.
ivec3 deviation(mat3 R, ivec3 centre, vec3 arm, ivec3 place) {
  precise vec3 goal = (R[0] * arm.x + R[1] * arm.y + R[2] * arm.z) * params.inverse_unit;
  return clamp(ivec3(uvec3(place) - uvec3(centre) - uvec3(ivec3(round(goal)))), ivec3(-(1 << 26)), ivec3(1 << 26));
}

/// The patch's vertices at rest, and how its handles' poses have to change; by the last invocations, which have the fewest
/// constraints. Needs a barrier behind it.
void find_poses(uint which, uint first, uint count) {
  for (uint v = gl_LocalInvocationIndex; v < count; v += $GROUPu) home[v] = rest[first + v];
  if (gl_LocalInvocationIndex == $GROUPu - 1u && (which >= $PATCHESu || lists[which * $HANDLESu] == ~0u)) held_count = 0u;
  for (uint k = $GROUPu - 1u - gl_LocalInvocationIndex; which < $PATCHESu && k < $HANDLESu; k += $GROUPu) {
    uint place = which * $HANDLESu + k, handle = lists[place];
    Handle h = handles[place];
    if (handle == ~0u) break;
    if (k + 1u == $HANDLESu || lists[place + 1u] == ~0u) held_count = k + 1u;
    handle_numbers[k] = handle;
    uint row = row_of(0u, handle);
    float unit_steps = params.inverse_unit / h.steps_per_metre;
    mat3 R = mat3(floats_of(row + 24u), floats_of(row + 27u), floats_of(row + 30u)), change = mat3(0.0);
    ivec3 move = ivec3(0);
    vec3 move_rest = vec3(0.0);
    if ((turn.x & PHASE_PLACES) == 0u) {
      dvec3 mean = dvec3(exact_sum_of(row, 0u), exact_sum_of(row, 1u), exact_sum_of(row, 2u)) / double(h.weight);
      move = ivec3(mean);
      vec3 sum = vec3(mean);
      mat3 B = transpose(R) * mat3(sums_of(row, 3u) - sum * h.steps.x, sums_of(row, 6u) - sum * h.steps.y, sums_of(row, 9u) - sum * h.steps.z);
      change = R * small_rotation(symmetric(h.squares, h.products) * unit_steps, B, symmetric(h.inverse_squares, h.inverse_products) / unit_steps) * unit_steps;
      move_rest = vec3(mean - dvec3(move)) - change * (h.steps / h.weight);
    }
    held[k] = Held(h.node, h.centre, h.cell, h.steps_per_metre, R, ivec3(rows[row + 33u], rows[row + 34u], rows[row + 35u]), change, move, move_rest);
  }
}
/// How far its handles pull the patch's vertex v, m.
vec3 handle_pull(uint v, ivec3 place) {
  vec4 own = home[v];
  vec3 pull = vec3(0.0);
  uint many = held_count;
  for (uint k = 0u; k < many; ++k) {
    int weight = handle_weight(own, held[k].node);
    if (weight != 0) {
      vec3 arm = handle_arm(own, held[k].centre, held[k].cell);
      ivec3 whole = held[k].move - deviation(held[k].R, held[k].place, arm, place);
      pull += float(weight) * (vec3(whole) + (held[k].move_rest + held[k].turn * vec3(handle_steps(arm, held[k].steps_per_metre))));
    }
  }
  return pull / own.w * params.unit;
}
/// Changes the poses, and adds what the new places, in here[], deviate from them to the sums. Has barriers. Uses here[] behind the
/// patch's own vertices for the patch's sums: four pairs of low and high words a handle.
void add_to_handles(uint which, uint count) {
  uint many = held_count, me = gl_LocalInvocationIndex;
  for (uint k = me; k < many; k += $GROUPu) {
    precise mat3 R = held[k].R + held[k].turn * (held[k].steps_per_metre * params.unit);
    R = R * (mat3(1.5) - 0.5 * (transpose(R) * R));  // what rounding does to it stays small
    ivec3 place = ivec3(uvec3(held[k].place) + uvec3(held[k].move));
    held[k].R = R;
    held[k].place = place;
    uint handle = handle_numbers[k], row = row_of(1u, handle);
    if (handles[which * $HANDLESu + k].keeper == which) {
      keep_words(row + 24u, floatBitsToUint(R[0]));
      keep_words(row + 27u, floatBitsToUint(R[1]));
      keep_words(row + 30u, floatBitsToUint(R[2]));
      keep_words(row + 33u, uvec3(place));
      for (uint word = 0u; word < 24u; ++word) rows[row_of(2u, handle) + word] = 0u;
    }
  }
  for (uint k = me; k < 8u * many; k += $GROUPu) here[$SUMMEDu + k] = ivec4(0);
  barrier();
  // An invocation a handle and a strip of the vertices: as many strips as there are invocations for.
  uint strips = max($GROUPu / max(many, 1u), 1u);
  for (uint k = me; k < many * strips; k += $GROUPu) {
    uint slot = k / strips;
    uvec3 low[4];
    ivec3 high[4];
    for (int q = 0; q < 4; ++q) low[q] = uvec3(0u), high[q] = ivec3(0);
    bool any = false;
    for (uint v = k % strips; v < count; v += strips) {
      int weight = handle_weight(home[v], held[slot].node);
      if (weight != 0) {
        any = true;
        vec3 arm = handle_arm(home[v], held[slot].centre, held[slot].cell);
        ivec4 factors = ivec4(1, handle_steps(arm, held[slot].steps_per_metre)) * weight;
        ivec3 away = deviation(held[slot].R, held[slot].place, arm, here[v].xyz);
        for (int q = 0; q < 4; ++q) {
          ivec3 more_high, more_low;
          uvec3 carry;
          imulExtended(ivec3(factors[q]), away, more_high, more_low);
          low[q] = uaddCarry(low[q], uvec3(more_low), carry);
          high[q] += more_high + ivec3(carry);
        }
      }
    }
    for (int q = 0; q < 4 && any; ++q) {
      uint at = $SUMMEDu + 8u * slot + 2u * uint(q);
      uvec3 before = uvec3(atomicAdd(here[at].x, int(low[q].x)), atomicAdd(here[at].y, int(low[q].y)), atomicAdd(here[at].z, int(low[q].z)));
      high[q] += ivec3(lessThan(before + low[q], before));
      atomicAdd(here[at + 1u].x, high[q].x);
      atomicAdd(here[at + 1u].y, high[q].y);
      atomicAdd(here[at + 1u].z, high[q].z);
    }
  }
  barrier();
  for (uint k = me; k < 12u * many; k += $GROUPu) {
    uint s = k % 12u, at = row_of(1u, handle_numbers[k / 12u]) + 2u * s, from = $SUMMEDu + 8u * (k / 12u) + 2u * (s / 3u);
    uint low = uint(here[from][s % 3u]), before = atomicAdd(rows[at], low);
    atomicAdd(rows[at + 1u], uint(here[from + 1u][s % 3u]) + (before + low < before ? 1u : 0u));
  }
}
