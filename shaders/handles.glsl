// Rigid handles on the GPU (sim/handles.h). A handle has a pose; what its vertices deviate from it, in whole units of places, times
// whole weights, is added up in 64 bits by the patches that move them, and the next dispatch's patches find from that how the pose has
// to change. All sums are exact, and a pull uses the same integers, so momentum stays to rounding of the pulls themselves.
#include "rigid.glsl"
// HANDLE_ROW words of a handle: 12 sums W {1, steps} x deviation, low and high words; the pose they are from, as R and the centre's place.
layout(std430, binding = BIND_HANDLES) restrict readonly buffer Handles { Handle handles[]; };
layout(std430, binding = BIND_HANDLE_LISTS) restrict readonly buffer HandleLists { uint lists[]; };  // of a patch: how many, which
layout(std430, binding = BIND_HANDLE_REST) restrict readonly buffer HandleRest { vec4 rest[]; };     // of a vertex: in cells; mass
layout(std430, binding = BIND_HANDLE_SUMS) buffer HandleSums { uint rows[]; };  // three sets: read, added to, cleared, by turns
shared vec4 home[$SUMMED];
// Of each handle of the patch: the pose its sums are from, the next one, the change between both as units a step, and of the place in
// whole units and the rest.
shared mat3 poses[$HANDLES], next_poses[$HANDLES], turns[$HANDLES];
shared ivec3 centres[$HANDLES], moves[$HANDLES];
shared vec3 move_rests[$HANDLES];
shared uint low_sums[12 * $HANDLES], high_sums[12 * $HANDLES];

uint handle_count(uint which) { return which < $PATCHESu ? lists[which * ($HANDLESu + 1u)] : 0u; }
uint handle_of(uint which, uint k) { return lists[which * ($HANDLESu + 1u) + 1u + k]; }
uint row_of(uint offset, uint handle) { return (((turn.x >> TURN_BITS) + offset) % 3u * $HANDLE_COUNTu + handle) * HANDLE_ROW; }
double sum_of(uint row, uint k) { return double(int(rows[row + 2u * k + 1u])) * 4294967296.0LF + double(rows[row + 2u * k]); }
dvec3 sums_of(uint row, uint k) { return dvec3(sum_of(row, k), sum_of(row, k + 1u), sum_of(row, k + 2u)); }
vec3 floats_of(uint at) { return uintBitsToFloat(uvec3(rows[at], rows[at + 1u], rows[at + 2u])); }
void keep_words(uint at, uvec3 words) {
  rows[at] = words.x;
  rows[at + 1u] = words.y;
  rows[at + 2u] = words.z;
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
  for (uint k = $GROUPu - 1u - gl_LocalInvocationIndex; k < handle_count(which); k += $GROUPu) {
    uint handle = handle_of(which, k), row = row_of(0u, handle);
    Handle h = handles[handle];
    mat3 R = mat3(floats_of(row + 24u), floats_of(row + 27u), floats_of(row + 30u)), next = R;
    dmat3 change = dmat3(0.0LF);
    dvec3 move = dvec3(0.0LF);
    if ((turn.x & PHASE_PLACES) == 0u) {
      dvec3 sum = sums_of(row, 0u), mean = sum / double(h.weight);
      double unit_steps = double(params.inverse_unit) / double(h.steps_per_metre);
      dmat3 spread = dmat3(dvec3(h.squares.x, h.products.z, h.products.y), dvec3(h.products.z, h.squares.y, h.products.x),
                           dvec3(h.products.y, h.products.x, h.squares.z));
      dmat3 A = (dmat3(R) * spread) * unit_steps;
      A += dmat3(sums_of(row, 3u) - mean * double(h.steps.x), sums_of(row, 6u) - mean * double(h.steps.y), sums_of(row, 9u) - mean * double(h.steps.z));
      dmat3 turned = rotation_of(A);
      change = (turned - dmat3(R)) * unit_steps;
      move = mean - change * (dvec3(h.steps) / double(h.weight));
      next = mat3(turned);
    }
    poses[k] = R;
    next_poses[k] = next;
    turns[k] = mat3(change);
    centres[k] = ivec3(rows[row + 33u], rows[row + 34u], rows[row + 35u]);
    moves[k] = ivec3(move);
    move_rests[k] = vec3(move - dvec3(ivec3(move)));
  }
}
/// How far its handles pull the patch's vertex v, m.
vec3 handle_pull(uint which, uint v, ivec3 place) {
  vec3 pull = vec3(0.0);
  for (uint k = 0u; k < handle_count(which); ++k) {
    Handle h = handles[handle_of(which, k)];
    int weight = handle_weight(home[v], h.node);
    if (weight != 0) {
      vec3 arm = handle_arm(home[v], h.centre, h.cell);
      vec3 steps = vec3(handle_steps(arm, h.steps_per_metre));
      ivec3 whole = moves[k] - deviation(poses[k], centres[k], arm, place);
      pull += float(weight) * (vec3(whole) + (move_rests[k] + turns[k] * steps));
    }
  }
  return pull / home[v].w * params.unit;
}
/// Changes the poses, and adds what the new places, in here[], deviate from them to the sums. Has barriers.
void add_to_handles(uint which, uint count) {
  uint many = handle_count(which), me = gl_LocalInvocationIndex;
  for (uint k = me; k < many; k += $GROUPu) {
    uint handle = handle_of(which, k), row = row_of(1u, handle);
    ivec3 centre = ivec3(uvec3(centres[k]) + uvec3(moves[k]));
    centres[k] = centre;
    if (handles[handle].keeper == which) {
      keep_words(row + 24u, floatBitsToUint(next_poses[k][0]));
      keep_words(row + 27u, floatBitsToUint(next_poses[k][1]));
      keep_words(row + 30u, floatBitsToUint(next_poses[k][2]));
      keep_words(row + 33u, uvec3(centre));
      for (uint word = 0u; word < 24u; ++word) rows[row_of(2u, handle) + word] = 0u;
    }
  }
  for (uint k = me; k < 12u * many; k += $GROUPu) low_sums[k] = high_sums[k] = 0u;
  barrier();
  // An invocation a handle, one of {1, steps}, and a strip of the vertices: as many as there are invocations for.
  uint strips = max($GROUPu / max(4u * many, 1u), 1u);
  for (uint k = me; k < 4u * many * strips; k += $GROUPu) {
    uint slot = k / (4u * strips), q = k / strips % 4u;
    Handle h = handles[handle_of(which, slot)];
    uvec3 low = uvec3(0u);
    ivec3 high = ivec3(0);
    bool any = false;
    for (uint v = k % strips; v < count; v += strips) {
      int weight = handle_weight(home[v], h.node);
      if (weight != 0) {
        any = true;
        vec3 arm = handle_arm(home[v], h.centre, h.cell);
        ivec3 steps = handle_steps(arm, h.steps_per_metre), more_high, more_low;
        uvec3 carry;
        weight *= q == 0u ? 1 : q == 1u ? steps.x : q == 2u ? steps.y : steps.z;
        imulExtended(ivec3(weight), deviation(next_poses[slot], centres[slot], arm, here[v].xyz), more_high, more_low);
        low = uaddCarry(low, uvec3(more_low), carry);
        high += more_high + ivec3(carry);
      }
    }
    if (any) {
      uint at = 12u * slot + 3u * q;
      uvec3 before = uvec3(atomicAdd(low_sums[at], low.x), atomicAdd(low_sums[at + 1u], low.y), atomicAdd(low_sums[at + 2u], low.z));
      high += ivec3(lessThan(before + low, before));
      atomicAdd(high_sums[at], uint(high.x));
      atomicAdd(high_sums[at + 1u], uint(high.y));
      atomicAdd(high_sums[at + 2u], uint(high.z));
    }
  }
  barrier();
  for (uint k = me; k < 12u * many; k += $GROUPu) {
    uint at = row_of(1u, handle_of(which, k / 12u)) + 2u * (k % 12u);
    uint before = atomicAdd(rows[at], low_sums[k]);
    atomicAdd(rows[at + 1u], high_sums[k] + (before + low_sums[k] < before ? 1u : 0u));
  }
}
