// Shape-matching clusters on the GPU (sim/solvers/clusters.h). A cluster has a pose; what its vertices deviate from it, in whole quanta, times
// whole weights, is added up in 64 bits by the patches that move them, and the next dispatch's patches find from that how the pose has
// to change. All sums are exact, and a pull uses the same integers, so momentum stays to rounding of the pulls themselves.
#include "shape_matching.glsl"
// CLUSTER_ROW words of a cluster: 12 sums W {1, steps} x deviation, each as partial sums of 16, 16 and 32 bits; the pose they are from, as R and
// the centre's place. Partial sums carry nothing to each other while patches add to them, so nobody waits for what was there before.
uniform uint cluster_set;
layout(std430, binding = BIND_CLUSTERS) restrict readonly buffer Clusters { Cluster clusters[]; };        // of each patch, CLUSTERS slots
layout(std430, binding = BIND_CLUSTER_REST) restrict readonly buffer ClusterRest { vec4 rest[]; };        // of a vertex: in cells; mass
layout(std430, binding = BIND_CLUSTER_SUMS) buffer ClusterSums { uint rows[]; };  // three sets: read, added to, cleared, by turns
shared vec4 local_rest[MAX_OWNED];
// Of each cluster of the patch: its pose.
struct Pose {
  mat3 R;         // pose of the sums, and where it has the centre
  ivec3 place;
  mat3 turn;      // how R has to change, quanta per step
  ivec3 move;     // and the place, whole quanta and the rest
  vec3 move_rest;
};
shared Cluster local_clusters[CLUSTERS];
shared Pose poses[CLUSTERS];
shared uint words[CLUSTER_ROW * CLUSTERS];  // of its row; later the patch's partial sums
shared uint local_count;
// Of pairs of a vertex and a cluster, PAIR_CLUSTERS at a time; the first take the room of other patches' vertices in local_positions[].
#define PAIR_AWAY MAX_OWNED
shared int pair_factors[4 * PAIR_CLUSTERS * MAX_OWNED];

uint row_of(uint offset, uint cluster) { return ((cluster_set + offset) % 3u * CLUSTER_COUNT + cluster) * CLUSTER_ROW; }
vec3 floats_of(uint at) { return uintBitsToFloat(uvec3(words[at], words[at + 1u], words[at + 2u])); }
// A sum, low word first, with what parts carry.
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
// How far a vertex is from where its cluster's pose has it, quanta. Float rounds where the pose has it, to 1e-7 of the arm, always alike.
ivec3 deviation(mat3 R, ivec3 centre, vec3 arm, ivec3 place) {
  precise vec3 goal = (R[0] * arm.x + R[1] * arm.y + R[2] * arm.z) * params.inverse_quantum;
  return clamp(ivec3(uvec3(place) - uvec3(centre) - uvec3(ivec3(round(goal)))), ivec3(-(1 << 26)), ivec3(1 << 26));
}

/// The patch's vertices at rest, and what its clusters are. Needs a barrier behind it.
void load_clusters(uint which, uint first, uint count) {
  uint me = gl_LocalInvocationIndex, from = min(which, PATCH_COUNT - 1u) * CLUSTERS;
  for (uint v = me; v < count; v += GROUP_SIZE) local_rest[v] = rest[first + v];
  if (me == 0u) local_count = 0u;
  for (uint k = me; k < CLUSTERS; k += GROUP_SIZE) local_clusters[k] = clusters[from + k];
  for (uint t = me; t < CLUSTER_ROW * CLUSTERS; t += GROUP_SIZE) {
#if ALL_CLUSTERS
    uint cluster = t / CLUSTER_ROW;  // nobody waits for its number
#else
    uint cluster = min(clusters[from + t / CLUSTER_ROW].number, CLUSTER_COUNT - 1u);
#endif
    words[t] = rows[row_of(0u, cluster) + t % CLUSTER_ROW];
  }
}
/// How the poses of the patch's clusters have to change; by the last invocations, which have the fewest constraints. Needs a barrier
/// behind it.
void find_poses() {
  for (uint k = GROUP_SIZE - 1u - gl_LocalInvocationIndex; k < CLUSTERS; k += GROUP_SIZE) {
    Cluster h = local_clusters[k];
    if (h.number == ~0u) break;
    if (k + 1u == CLUSTERS || local_clusters[k + 1u].number == ~0u) local_count = k + 1u;
    uint row = CLUSTER_ROW * k;
    float unit_steps = params.inverse_quantum / h.steps_per_metre;
    mat3 R = mat3(floats_of(row + 36u), floats_of(row + 39u), floats_of(row + 42u)), change = mat3(0.0);
    ivec3 move = ivec3(0);
    vec3 move_rest = vec3(0.0);
    if ((phases & PHASE_SUMS) == 0u) {
      divide(exact_sum_of(row, 0u), h.weight, move.x, move_rest.x);
      divide(exact_sum_of(row, 1u), h.weight, move.y, move_rest.y);
      divide(exact_sum_of(row, 2u), h.weight, move.z, move_rest.z);
      vec3 sum = vec3(move) + move_rest;
      mat3 B = transpose(R) * mat3(sums_of(row, 3u) - sum * h.steps.x, sums_of(row, 6u) - sum * h.steps.y, sums_of(row, 9u) - sum * h.steps.z);
      change = R * small_rotation(symmetric(h.squares, h.products) * unit_steps, B, symmetric(h.inverse_squares, h.inverse_products) / unit_steps) * unit_steps;
      move_rest -= change * (h.steps / h.weight);
    }
    poses[k] = Pose(R, ivec3(words[row + 45u], words[row + 46u], words[row + 47u]), change, move, move_rest);
  }
}
/// How far its clusters pull this invocation's vertex of the patch, m. Has barriers.
vec3 cluster_pull(uint first, uint count) {
  uint me = gl_LocalInvocationIndex, many = local_count;
  vec3 pull = vec3(0.0);
  for (uint base = 0u; base < many; base += PAIR_CLUSTERS) {
    uint width = min(many - base, uint(PAIR_CLUSTERS));
    for (uint p = me; p < width * count; p += GROUP_SIZE) {
      uint v = p / width, k = base + p % width;
      int weight = cluster_weight(local_rest[v], local_clusters[k].node);
      vec3 arm = cluster_arm(local_rest[v], local_clusters[k].centre, local_clusters[k].cell);
      ivec3 whole = poses[k].move - deviation(poses[k].R, poses[k].place, arm, quantized[first + v].xyz);
      vec3 part = float(weight) * (vec3(whole) + (poses[k].move_rest + poses[k].turn * vec3(cluster_steps(arm, local_clusters[k].steps_per_metre))));
      local_positions[PAIR_AWAY + p] = ivec4(floatBitsToInt(part), 0);
    }
    barrier();
    for (uint k = 0u; me < count && k < width; ++k) pull += intBitsToFloat(local_positions[PAIR_AWAY + me * width + k].xyz);
    if (base + PAIR_CLUSTERS < many) barrier();
  }
  return me < count ? pull / local_rest[me].w * params.quantum : pull;
}
/// Changes the poses, and adds what the new places, in local_positions[], deviate from them to the sums. Has barriers.
void add_to_clusters(uint which, uint count) {
  uint many = local_count, me = gl_LocalInvocationIndex;
  for (uint k = GROUP_SIZE - 1u - me; k < many; k += GROUP_SIZE) {
    precise mat3 R = poses[k].R + poses[k].turn * (local_clusters[k].steps_per_metre * params.quantum);
    R = R * (mat3(1.5) - 0.5 * (transpose(R) * R));  // what rounding does to it stays small
    ivec3 place = ivec3(uvec3(poses[k].place) + uvec3(poses[k].move));
    poses[k].R = R;
    poses[k].place = place;
    if (local_clusters[k].owner == which) {
      uint row = row_of(1u, local_clusters[k].number), old = row_of(2u, local_clusters[k].number);
      keep_words(row + 36u, floatBitsToUint(R[0]));
      keep_words(row + 39u, floatBitsToUint(R[1]));
      keep_words(row + 42u, floatBitsToUint(R[2]));
      keep_words(row + 45u, uvec3(place));
      for (uint word = 0u; word < 36u; ++word) rows[old + word] = 0u;
    }
  }
  for (uint base = 0u; base < many; base += PAIR_CLUSTERS) {
    uint width = min(many - base, uint(PAIR_CLUSTERS));
    for (uint k = me; k < 36u * width; k += GROUP_SIZE) words[k] = 0u;
    barrier();
    for (uint p = me; p < width * count; p += GROUP_SIZE) {
      uint v = p / width, k = base + p % width;
      vec3 arm = cluster_arm(local_rest[v], local_clusters[k].centre, local_clusters[k].cell);
      ivec4 factors = ivec4(1, cluster_steps(arm, local_clusters[k].steps_per_metre)) * cluster_weight(local_rest[v], local_clusters[k].node);
      for (int q = 0; q < 4; ++q) pair_factors[4u * p + uint(q)] = factors[q];
      local_positions[PAIR_AWAY + p] = ivec4(deviation(poses[k].R, poses[k].place, arm, local_positions[v].xyz), 0);
    }
    barrier();
    // An invocation a factor of a cluster and a strip of the vertices. Neighbours have other words everywhere: none waits.
    uint columns = 4u * width, strips = GROUP_SIZE / columns, column = me % columns;
    if (me < strips * columns) {
      uvec3 low = uvec3(0u);
      ivec3 high = ivec3(0);
      for (uint v = me / columns; v < count; v += strips) {
        uint p = v * width + column / 4u;
        ivec3 more_high, more_low;
        uvec3 carry;
        imulExtended(ivec3(pair_factors[columns * v + column]), local_positions[PAIR_AWAY + p].xyz, more_high, more_low);
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
    for (uint k = me; k < 36u * width; k += GROUP_SIZE) {
      uint part = k % 3u, low = words[k - part], middle = words[k - part + 1u] + (low >> 16);
      uint value = part == 0u ? low & 0xffffu : part == 1u ? middle & 0xffffu : words[k] + (middle >> 16);
      atomicAdd(rows[row_of(1u, local_clusters[base + k / 36u].number) + k % 36u], value);
    }
    if (base + PAIR_CLUSTERS < many) barrier();
  }
}
