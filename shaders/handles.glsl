// Rigid handles on the GPU (sim/handles.h). A handle has a pose; what its vertices deviate from it, in whole units of places, times
// whole weights, is added up in 64 bits by the patches that move them, and the next dispatch's patches find from that how the pose has
// to change. All sums are exact, and a pull uses the same integers, so momentum stays to rounding of the pulls themselves.
#include "rigid.glsl"
// HANDLE_ROW words of a handle: 12 sums W {1, steps} x deviation, each as limbs of 16, 16 and 32 bits; the pose they are from, as R and
// the centre's place. Limbs carry nothing to each other while patches add to them, so nobody waits for what was there before.
layout(std430, binding = BIND_HANDLES) restrict readonly buffer Handles { Handle handles[]; };       // of each patch, $HANDLES places
layout(std430, binding = BIND_HANDLE_REST) restrict readonly buffer HandleRest { vec4 rest[]; };     // of a vertex: in cells; mass
layout(std430, binding = BIND_HANDLE_SUMS) buffer HandleSums { uint rows[]; };  // three sets: read, added to, cleared, by turns
shared vec4 home[$SUMMED];
// Of each handle of the patch.
struct Held {
  mat3 R;         // pose of the sums, and where it has the centre
  ivec3 place;
  mat3 turn;      // how R has to change, units a step
  ivec3 move;     // and the place, whole units and the rest
  vec3 move_rest;
};
shared Handle own[$HANDLES];
shared Held held[$HANDLES];
shared uint words[HANDLE_ROW * $HANDLES];  // of its row; later the patch's limbs
shared uint held_count;
// Of pairs of a vertex and a handle, $CHUNK handles at a time; the first take the room of other patches' vertices in here[].
#define PAIR_AWAY $SUMMEDu
shared int pair_factors[4 * $CHUNK * $SUMMED];

uint row_of(uint offset, uint handle) { return (((turn.x >> TURN_BITS) + offset) % 3u * $HANDLE_COUNTu + handle) * HANDLE_ROW; }
vec3 floats_of(uint at) { return uintBitsToFloat(uvec3(words[at], words[at + 1u], words[at + 2u])); }
// A sum, low word first, with what limbs carry.
uvec2 exact_sum_of(uint row, uint k) {
  uint at = row + 3u * k, low = words[at], middle = words[at + 1u] + (low >> 16);
  return uvec2((middle << 16) | (low & 0xffffu), words[at + 2u] + (middle >> 16));
}
float float_of(uvec2 sum) {  // by its size: the low word of a small negative number is large
  bool negative = int(sum.y) < 0;
  if (negative) sum = uvec2(~sum.x + 1u, ~sum.y + (sum.x == 0u ? 1u : 0u));
  float size = float(sum.y) * 4294967296.0 + float(sum.x);
  return negative ? -size : size;
}
float sum_of(uint row, uint k) { return float_of(exact_sum_of(row, k)); }
// sum / weight as a whole number and the rest, which a float holds.
void divide(uvec2 sum, float weight, out int whole, out float rest) {
  whole = int(round(float_of(sum) / weight));
  int high, low;
  imulExtended(whole, int(weight), high, low);
  uint borrow;
  sum.x = usubBorrow(sum.x, uint(low), borrow);
  sum.y -= uint(high) + borrow;
  rest = float_of(sum) / weight;
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

/// The patch's vertices at rest, and what its handles are. Needs a barrier behind it.
void load_handles(uint which, uint first, uint count) {
  uint me = gl_LocalInvocationIndex, from = min(which, $PATCHESu - 1u) * $HANDLESu;
  for (uint v = me; v < count; v += $GROUPu) home[v] = rest[first + v];
  if (me == 0u) held_count = 0u;
  for (uint k = me; k < $HANDLESu; k += $GROUPu) own[k] = handles[from + k];
  for (uint t = me; t < HANDLE_ROW * $HANDLESu; t += $GROUPu) {
#if $ALL_HANDLES
    uint handle = t / HANDLE_ROW;  // nobody waits for its number
#else
    uint handle = min(handles[from + t / HANDLE_ROW].number, $HANDLE_COUNTu - 1u);
#endif
    words[t] = rows[row_of(0u, handle) + t % HANDLE_ROW];
  }
}
/// How the poses of the patch's handles have to change; by the last invocations, which have the fewest constraints. Needs a barrier
/// behind it.
void find_poses() {
  for (uint k = $GROUPu - 1u - gl_LocalInvocationIndex; k < $HANDLESu; k += $GROUPu) {
    Handle h = own[k];
    if (h.number == ~0u) break;
    if (k + 1u == $HANDLESu || own[k + 1u].number == ~0u) held_count = k + 1u;
    uint row = HANDLE_ROW * k;
    float unit_steps = params.inverse_unit / h.steps_per_metre;
    mat3 R = mat3(floats_of(row + 36u), floats_of(row + 39u), floats_of(row + 42u)), change = mat3(0.0);
    ivec3 move = ivec3(0);
    vec3 move_rest = vec3(0.0);
    if ((turn.x & PHASE_PLACES) == 0u) {
      divide(exact_sum_of(row, 0u), h.weight, move.x, move_rest.x);
      divide(exact_sum_of(row, 1u), h.weight, move.y, move_rest.y);
      divide(exact_sum_of(row, 2u), h.weight, move.z, move_rest.z);
      vec3 sum = vec3(move) + move_rest;
      mat3 B = transpose(R) * mat3(sums_of(row, 3u) - sum * h.steps.x, sums_of(row, 6u) - sum * h.steps.y, sums_of(row, 9u) - sum * h.steps.z);
      change = R * small_rotation(symmetric(h.squares, h.products) * unit_steps, B, symmetric(h.inverse_squares, h.inverse_products) / unit_steps) * unit_steps;
      move_rest -= change * (h.steps / h.weight);
    }
    held[k] = Held(R, ivec3(words[row + 45u], words[row + 46u], words[row + 47u]), change, move, move_rest);
  }
}
/// How far its handles pull this invocation's vertex of the patch, m. Has barriers.
vec3 handle_pull(uint first, uint count) {
  uint me = gl_LocalInvocationIndex, many = held_count;
  vec3 pull = vec3(0.0);
  for (uint base = 0u; base < many; base += $CHUNKu) {
    uint width = min(many - base, $CHUNKu);
    for (uint p = me; p < width * count; p += $GROUPu) {
      uint v = p / width, k = base + p % width;
      int weight = handle_weight(home[v], own[k].node);
      vec3 arm = handle_arm(home[v], own[k].centre, own[k].cell);
      ivec3 whole = held[k].move - deviation(held[k].R, held[k].place, arm, places[first + v].xyz);
      vec3 part = float(weight) * (vec3(whole) + (held[k].move_rest + held[k].turn * vec3(handle_steps(arm, own[k].steps_per_metre))));
      here[PAIR_AWAY + p] = ivec4(floatBitsToInt(part), 0);
    }
    barrier();
    for (uint k = 0u; me < count && k < width; ++k) pull += intBitsToFloat(here[PAIR_AWAY + me * width + k].xyz);
    if (base + $CHUNKu < many) barrier();
  }
  return me < count ? pull / home[me].w * params.unit : pull;
}
/// Changes the poses, and adds what the new places, in here[], deviate from them to the sums. Has barriers.
void add_to_handles(uint which, uint count) {
  uint many = held_count, me = gl_LocalInvocationIndex;
  for (uint k = $GROUPu - 1u - me; k < many; k += $GROUPu) {
    precise mat3 R = held[k].R + held[k].turn * (own[k].steps_per_metre * params.unit);
    R = R * (mat3(1.5) - 0.5 * (transpose(R) * R));  // what rounding does to it stays small
    ivec3 place = ivec3(uvec3(held[k].place) + uvec3(held[k].move));
    held[k].R = R;
    held[k].place = place;
    if (own[k].keeper == which) {
      uint row = row_of(1u, own[k].number), old = row_of(2u, own[k].number);
      keep_words(row + 36u, floatBitsToUint(R[0]));
      keep_words(row + 39u, floatBitsToUint(R[1]));
      keep_words(row + 42u, floatBitsToUint(R[2]));
      keep_words(row + 45u, uvec3(place));
      for (uint word = 0u; word < 36u; ++word) rows[old + word] = 0u;
    }
  }
  for (uint base = 0u; base < many; base += $CHUNKu) {
    uint width = min(many - base, $CHUNKu);
    for (uint k = me; k < 36u * width; k += $GROUPu) words[k] = 0u;
    barrier();
    for (uint p = me; p < width * count; p += $GROUPu) {
      uint v = p / width, k = base + p % width;
      vec3 arm = handle_arm(home[v], own[k].centre, own[k].cell);
      ivec4 factors = ivec4(1, handle_steps(arm, own[k].steps_per_metre)) * handle_weight(home[v], own[k].node);
      for (int q = 0; q < 4; ++q) pair_factors[4u * p + uint(q)] = factors[q];
      here[PAIR_AWAY + p] = ivec4(deviation(held[k].R, held[k].place, arm, here[v].xyz), 0);
    }
    barrier();
    // An invocation a factor of a handle and a strip of the vertices. Neighbours have other words everywhere: none waits.
    uint columns = 4u * width, strips = $GROUPu / columns, column = me % columns;
    if (me < strips * columns) {
      uvec3 low = uvec3(0u);
      ivec3 high = ivec3(0);
      for (uint v = me / columns; v < count; v += strips) {
        uint p = v * width + column / 4u;
        ivec3 more_high, more_low;
        uvec3 carry;
        imulExtended(ivec3(pair_factors[columns * v + column]), here[PAIR_AWAY + p].xyz, more_high, more_low);
        low = uaddCarry(low, uvec3(more_low), carry);
        high += more_high + ivec3(carry);
      }
      for (int axis = 0; axis < 3; ++axis) {
        uint at = 9u * column + 3u * uint(axis);
        atomicAdd(words[at], low[axis] & 0xffffu);
        atomicAdd(words[at + 1u], low[axis] >> 16);
        atomicAdd(words[at + 2u], uint(high[axis]));
      }
    }
    barrier();
    for (uint k = me; k < 36u * width; k += $GROUPu) {
      uint limb = k % 3u, low = words[k - limb], middle = words[k - limb + 1u] + (low >> 16);
      uint value = limb == 0u ? low & 0xffffu : limb == 1u ? middle & 0xffffu : words[k] + (middle >> 16);
      atomicAdd(rows[row_of(1u, own[base + k / 36u].number) + k % 36u], value);
    }
    if (base + $CHUNKu < many) barrier();
  }
}
