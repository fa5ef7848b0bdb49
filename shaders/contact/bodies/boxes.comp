// Broad phase: boxes around the surface of each body and, as one vertex that shakes must not count, around the mean
// velocities of its slices, with the largest root mean square of deviations from them. There is a work-group per slice
// and, if candidates are sought, behind these one per leaf for its box and the search radius of its items.
#include "contact/bodies/pairs.glsl"
layout(std430) restrict readonly buffer Positions { Position positions[]; };
layout(std430) restrict readonly buffer Velocities { Velocity velocities[]; };
shared vec3 lows[GROUP_SIZE];
shared vec4 highs[GROUP_SIZE];   // w: the largest square of a speed
shared vec4 speeds[GROUP_SIZE];  // sums of velocities and of their squares, or radii
// Leaves the box around all invocations, and the sum or the largest of their speeds, in element 0.
void reduce(uint lane, vec3 low, vec4 high, vec4 speed, bool sum) {
  lows[lane] = low, highs[lane] = high, speeds[lane] = speed;
  barrier();
  for (uint half_size = GROUP_SIZE / 2u; half_size > 0u; half_size /= 2u) {
    if (lane < half_size) {
      lows[lane] = min(lows[lane], lows[lane + half_size]);
      highs[lane] = max(highs[lane], highs[lane + half_size]);
      vec4 other = speeds[lane + half_size];
      speeds[lane] = sum ? speeds[lane] + other : max(speeds[lane], other);
    }
    barrier();
  }
}
void add_target(uint t, uvec3 corners, inout vec3 low, inout vec3 high) {
  vec3 a = positions[corners.x].high, b = positions[corners.y].high, c = positions[corners.z].high;
  vec3 lowest = min(a, min(b, c)), highest = max(a, max(b, c)), centre = 0.5 * (lowest + highest);
  pair_spheres[t] = vec4(centre, max(distance(a, centre), max(distance(b, centre), distance(c, centre))));
  low = min(low, lowest), high = max(high, highest);
}
void add_item(uint s, inout float reach) {
  if (held_by[s] != NONE) reach = max(reach, reach_of(depths[s]));
}
void leaf_box(uint leaf, uint lane) {
  vec3 low = vec3(1e30), high = vec3(-1e30);
  float reach = margin;
  for (uint t = leaves[leaf].triangles[0] + lane; t < leaves[leaf].triangles[1]; t += GROUP_SIZE)
    add_target(t, triangles[t].xyz, low, high);
  for (uint s = leaves[leaf].vertices[0] + lane; s < leaves[leaf].vertices[1]; s += GROUP_SIZE) add_item(s, reach);
  for (uint e = leaves[leaf].edges[0] + lane; e < leaves[leaf].edges[1]; e += GROUP_SIZE) {
    add_target(TRIANGLES + e, edge_vertices[e].xyy, low, high);
    add_item(SURFACE_VERTICES + e, reach);
  }
  reduce(lane, low, vec4(high, 0.0), vec4(reach), false);
  if (lane < 3u) {
    leaf_boxes[leaf].low[lane] = lows[0][lane];
    leaf_boxes[leaf].high[lane] = highs[0][lane];
  } else if (lane == 3u) {
    leaf_boxes[leaf].reach = speeds[0].x;
    atomicMax(counts.most_reach, floatBitsToUint(speeds[0].x));
  }
}
void main() {
  uint lane = gl_LocalInvocationIndex, slice = group_index();
  if (slice >= SLICES) {
    if (slice < SLICES + LEAVES) leaf_box(slice - SLICES, lane);
    return;
  }
  uint body = slices[slice].body, first = slices[slice].first, end = slices[slice].end;
  vec3 low = vec3(1e30);
  vec4 high = vec4(vec3(-1e30), 0.0), speed = vec4(0.0);
  const uint at_once = 4u;  // reads in flight, instead of one after the other
  for (uint s = first + lane; s < end; s += at_once * GROUP_SIZE) {
    vec3 x[at_once], v[at_once];
    for (uint j = 0u; j < at_once; ++j) {
      uint i = surface_vertex(min(s + j * GROUP_SIZE, end - 1u));
      x[j] = positions[i].high, v[j] = velocities[i].high;
    }
    for (uint j = 0u; j < at_once; ++j) {
      low = min(low, x[j]), high = max(high, vec4(x[j], dot(v[j], v[j])));
      if (s + j * GROUP_SIZE < end) speed += vec4(v[j], dot(v[j], v[j]));
    }
  }
  reduce(lane, low, high, speed, true);
  vec4 mean = speeds[0] / float(end - first);
  if (lane < 3u) {
    atomicMin(boxes[body].low[lane], sortable(lows[0][lane]));
    atomicMax(boxes[body].high[lane], sortable(highs[0][lane]));
    atomicMin(boxes[body].slowest[lane], sortable(mean[lane]));
    atomicMax(boxes[body].fastest[lane], sortable(mean[lane]));
  } else if (lane == 3u) {
    atomicMax(boxes[body].spread, floatBitsToUint(sqrt(max(mean.w - dot(mean.xyz, mean.xyz), 0.0))));
    atomicMax(boxes[body].top_speed, floatBitsToUint(sqrt(highs[0].w)));
  }
}
