// Fits the shadow map's projection to the bodies' bounds. The work-group that ends last finds it. Its size is in steps
// and its centre in whole texels, so that shadow edges do not crawl.
#include "layout.glsl"
#include "ordered.glsl"
#include "render/view.glsl"
layout(local_size_x = 128) in;
layout(std430) readonly buffer Positions { Position positions[]; };
layout(std430) coherent buffer Bounds {
  uint bounds[6];
  uint done;  // work-groups
};
layout(std430) writeonly buffer Fit { Light fitted; };
uniform uint count;
uniform float map_size;  // texels
uniform vec4 limit;      // centre and radius of the region that the map may cover
uniform vec3 obstacles_low, obstacles_high;  // bounds of obstacles; low > high if there are none
uniform float reach;     // m, the distance from the bodies up to which obstacles count

shared uint low_bits[3], high_bits[3];

void find_bounds(uint i, uint lane) {
  if (lane < 3u) {
    low_bits[lane] = 0xffffffffu;
    high_bits[lane] = 0u;
  }
  barrier();
  if (i < count) {
    vec3 p = positions[i].high;
    if (finite(p))
      for (int axis = 0; axis < 3; ++axis) {
        atomicMin(low_bits[axis], ordered(p[axis]));
        atomicMax(high_bits[axis], ordered(p[axis]));
      }
  }
  barrier();
  if (lane < 3u) {
    atomicMin(bounds[lane], low_bits[lane]);
    atomicMax(bounds[3u + lane], high_bits[lane]);
  }
}

void fit_light() {
  memoryBarrierBuffer();
  vec3 low = limit.xyz, high = limit.xyz;
  if (bounds[0] <= bounds[3])
    for (int a = 0; a < 3; ++a) {
      low[a] = clamp(decoded(bounds[a]), limit[a] - limit.w, limit[a] + limit.w);
      high[a] = clamp(decoded(bounds[3 + a]), limit[a] - limit.w, limit[a] + limit.w);
    }
  for (int a = 0; a < 3; ++a) bounds[a] = ~0u, bounds[3 + a] = 0u;  // for the next picture
  done = 0u;
  vec3 centre = 0.5 * (low + high), bodies = centre;
  vec3 half_size = max(0.5 * (high - low) * (1.0 + view.tets.y), vec3(1e-4 * limit.w));
  if (obstacles_low.x <= obstacles_high.x) {
    low = min(centre - half_size, clamp(obstacles_low, low - reach, high + reach));
    high = max(centre + half_size, clamp(obstacles_high, low - reach, high + reach));
    centre = 0.5 * (low + high);
    half_size = 0.5 * (high - low);
  }
  vec3 z = key_direction;
  vec3 x = normalize(cross(vec3(0.0, 1.0, 0.0), z));
  vec3 y = cross(z, x);
  float across = max(dot(abs(x), half_size), dot(abs(y), half_size));
  across = exp2(ceil(log2(across * 1.03) * 4.0) / 4.0);
  float texel = 2.0 * across / map_size;
  vec2 middle = floor(vec2(dot(x, centre), dot(y, centre)) / texel) * texel;
  float depth = dot(abs(z), half_size) * 1.05, front = dot(z, centre) + depth;
  // The rows of the matrix are (x.p - middle.x) / across, (y.p - middle.y) / across, and the depth below `front`,
  // -1..1.
  vec4 row0 = vec4(x, -middle.x) / across, row1 = vec4(y, -middle.y) / across;
  vec4 row2 = vec4(-z, front) / depth - vec4(0.0, 0.0, 0.0, 1.0);
  fitted.matrix = transpose(mat4(row0, row1, row2, vec4(0.0, 0.0, 0.0, 1.0)));
  fitted.centre = vec4(bodies, texel);
  fitted.extent = vec4(2.0 * depth, across, 0.0, 0.0);
}

void main() {
  uint lane = gl_LocalInvocationIndex;
  find_bounds(gl_WorkGroupID.y * gl_NumWorkGroups.x * 128u + gl_GlobalInvocationID.x, lane);
  memoryBarrierBuffer();
  barrier();
  if (lane == 0u && atomicAdd(done, 1u) == gl_NumWorkGroups.x * gl_NumWorkGroups.y - 1u) fit_light();
}
