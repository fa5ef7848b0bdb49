// Rigid handles on the GPU (sim/handles.h). A handle has a pose; what its vertices deviate from it, in whole units of places, times
// whole weights, is added up in 64 bits by the patches that move them, and the next dispatch's patches find from that how the pose has
// to change. All sums are exact, and a pull uses the same integers, so momentum stays to rounding of the pulls themselves.
#include "rigid.glsl"
// HANDLE_ROW words of a handle: 12 sums W {1, steps} x deviation, low and high words; the pose they are from: R in doubles, place
layout(std430, binding = BIND_HANDLES) restrict readonly buffer Handles { Handle handles[]; };
layout(std430, binding = BIND_HANDLE_LISTS) restrict readonly buffer HandleLists { uint lists[]; };  // of a patch: how many, which
layout(std430, binding = BIND_HANDLE_REST) restrict readonly buffer HandleRest { vec4 rest[]; };     // of a vertex: in cells; mass
layout(std430, binding = BIND_HANDLE_SUMS) buffer HandleSums { uint rows[]; };  // three sets: read, added to, cleared, by turns
struct Pose {
  dmat3 R;      // of the sums
  dmat3 turn;   // how much it has to change, times units a step
  dvec3 move;   // and its place, units
  ivec3 place;  // of the centre
};
shared vec4 home[$SUMMED];
shared Pose poses[$HANDLES];
shared uint low_sums[12 * $HANDLES], high_sums[12 * $HANDLES];

uint handle_count(uint which) { return which < $PATCHESu ? lists[which * ($HANDLESu + 1u)] : 0u; }
uint handle_of(uint which, uint k) { return lists[which * ($HANDLESu + 1u) + 1u + k]; }
uint row_of(uint offset, uint handle) { return (((turn.x >> TURN_BITS) + offset) % 3u * $HANDLE_COUNTu + handle) * HANDLE_ROW; }
double sum_of(uint row, uint k) { return double(int(rows[row + 2u * k + 1u])) * 4294967296.0LF + double(rows[row + 2u * k]); }
dvec3 sums_of(uint row, uint k) { return dvec3(sum_of(row, k), sum_of(row, k + 1u), sum_of(row, k + 2u)); }
double double_of(uint at) { return packDouble2x32(uvec2(rows[at], rows[at + 1u])); }
dvec3 doubles_of(uint at) { return dvec3(double_of(at), double_of(at + 2u), double_of(at + 4u)); }
void keep_double(uint at, double value) {
  uvec2 words = unpackDouble2x32(value);
  rows[at] = words.x;
  rows[at + 1u] = words.y;
}
// No component of a vector of doubles is written by an index that is not constant: a driver cannot link that (docs/decisions.md).
void keep_doubles(uint at, dvec3 value) {
  keep_double(at, value.x);
  keep_double(at + 2u, value.y);
  keep_double(at + 4u, value.z);
}
void add_64(inout uint low, inout int high, int a, int b) {
  int more_high, more_low;
  uint carry;
  imulExtended(a, b, more_high, more_low);
  low = uaddCarry(low, uint(more_low), carry);
  high += more_high + int(carry);
}
// How far a vertex is from where its handle's pose has it, units.
ivec3 deviation(Pose pose, vec3 arm, ivec3 place) {
  precise dvec3 goal = pose.R * (dvec3(arm) * double(params.inverse_unit));
  return clamp(ivec3(uvec3(place) - uvec3(pose.place) - uvec3(ivec3(floor(goal + 0.5LF)))), -(1 << 26), 1 << 26);
}

/// The patch's vertices at rest, and how its handles' poses have to change; by the last invocations, which have the fewest
/// constraints. Needs a barrier behind it.
void find_poses(uint which, uint first, uint count) {
  for (uint v = gl_LocalInvocationIndex; v < count; v += $GROUPu) home[v] = rest[first + v];
  for (uint k = $GROUPu - 1u - gl_LocalInvocationIndex; k < handle_count(which); k += $GROUPu) {
    uint handle = handle_of(which, k), row = row_of(0u, handle);
    Handle h = handles[handle];
    Pose pose;
    pose.R = dmat3(doubles_of(row + 24u), doubles_of(row + 30u), doubles_of(row + 36u));
    pose.place = ivec3(rows[row + 42u], rows[row + 43u], rows[row + 44u]);
    pose.turn = dmat3(0.0LF);
    pose.move = dvec3(0.0LF);
    if ((turn.x & PHASE_PLACES) == 0u) {
      double mass = double(h.weight);
      dvec3 sum = sums_of(row, 0u);
      double unit_steps = double(params.inverse_unit) / double(h.steps_per_metre);
      dmat3 spread = dmat3(h.squares.x, h.products.z, h.products.y, h.products.z, h.squares.y, h.products.x, h.products.y, h.products.x,
                           h.squares.z);
      dmat3 A = pose.R * spread * unit_steps;
      dvec3 mean = sum / mass;
      A += dmat3(sums_of(row, 3u) - mean * double(h.steps.x), sums_of(row, 6u) - mean * double(h.steps.y), sums_of(row, 9u) - mean * double(h.steps.z));
      pose.turn = (rotation_of(A) - pose.R) * unit_steps;
      pose.move = (sum - pose.turn * dvec3(h.steps)) / mass;
    }
    poses[k] = pose;
  }
}
/// How far its handles pull the patch's vertex v, m.
vec3 handle_pull(uint which, uint v, ivec3 place) {
  dvec3 pull = dvec3(0.0LF);
  for (uint k = 0u; k < handle_count(which); ++k) {
    Handle h = handles[handle_of(which, k)];
    int weight = handle_weight(home[v], h.node);
    if (weight != 0) {
      vec3 arm = handle_arm(home[v], h.centre, h.cell);
      pull += double(weight) * (poses[k].move + poses[k].turn * dvec3(handle_steps(arm, h.steps_per_metre)) -
                                dvec3(deviation(poses[k], arm, place)));
    }
  }
  return vec3(pull / double(home[v].w)) * params.unit;
}
/// Changes the poses, and adds what the new places, in here[], deviate from them to the sums. Has barriers.
void add_to_handles(uint which, uint count) {
  uint many = handle_count(which), me = gl_LocalInvocationIndex;
  for (uint k = me; k < many; k += $GROUPu) {
    Pose pose = poses[k];
    uint handle = handle_of(which, k), row = row_of(1u, handle);
    Handle h = handles[handle];
    pose.R += pose.turn * (double(h.steps_per_metre) * double(params.unit));
    pose.place = ivec3(uvec3(pose.place) + uvec3(ivec3(floor(pose.move + 0.5LF))));
    poses[k] = pose;
    if (h.keeper == which) {
      keep_doubles(row + 24u, pose.R[0]);
      keep_doubles(row + 30u, pose.R[1]);
      keep_doubles(row + 36u, pose.R[2]);
      rows[row + 42u] = uint(pose.place.x);
      rows[row + 43u] = uint(pose.place.y);
      rows[row + 44u] = uint(pose.place.z);
      for (uint word = 0u; word < 24u; ++word) rows[row_of(2u, handle) + word] = 0u;
    }
  }
  for (uint k = me; k < 12u * many; k += $GROUPu) low_sums[k] = high_sums[k] = 0u;
  barrier();
  // Vertices in as many strips as there are invocations for.
  uint strips = max($GROUPu / max(many, 1u), 1u);
  for (uint k = me; k < many * strips; k += $GROUPu) {
    uint slot = k / strips;
    Handle h = handles[handle_of(which, slot)];
    uint low[12];
    int high[12];
    for (int s = 0; s < 12; ++s) low[s] = 0u, high[s] = 0;
    bool any = false;
    for (uint v = k % strips; v < count; v += strips) {
      int weight = handle_weight(home[v], h.node);
      if (weight != 0) {
        any = true;
        vec3 arm = handle_arm(home[v], h.centre, h.cell);
        ivec3 steps = handle_steps(arm, h.steps_per_metre), away = deviation(poses[slot], arm, here[v].xyz);
        for (int a = 0; a < 3; ++a) {
          add_64(low[a], high[a], weight, away[a]);
          for (int q = 0; q < 3; ++q) add_64(low[3 + 3 * q + a], high[3 + 3 * q + a], weight * steps[q], away[a]);
        }
      }
    }
    if (any)
      for (uint s = 0u; s < 12u; ++s) {
        uint before = atomicAdd(low_sums[12u * slot + s], low[s]);
        atomicAdd(high_sums[12u * slot + s], uint(high[s]) + (before + low[s] < before ? 1u : 0u));
      }
  }
  barrier();
  for (uint k = me; k < 12u * many; k += $GROUPu) {
    uint at = row_of(1u, handle_of(which, k / 12u)) + 2u * (k % 12u);
    uint before = atomicAdd(rows[at], low_sums[k]);
    atomicAdd(rows[at + 1u], high_sums[k] + (before + low_sums[k] < before ? 1u : 0u));
  }
}
