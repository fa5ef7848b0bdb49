// Finds the parts of the key light and of the sky that arrive on the ground and on walls, in one map for each, seen
// along the light, so that a pixel of the picture needs a single sample.
#include "render/view.glsl"
#include "render/light.glsl"
layout(local_size_x = 16, local_size_y = 16) in;
layout(rg8, binding = IMAGE_PLANES) writeonly uniform image2D arrived;
layout(std430) readonly buffer Corners { SurfaceCorner corners[]; };
uniform uint triangles;
uniform int map_size;  // texels a side

shared float parts[256];

// The point where the ray of light through a point of the map, in texels, hits the plane.
vec3 on_plane(vec2 texel, vec4 plane) {
  vec2 at = (texel / float(map_size) * 2.0 - 1.0) * plane_reach;
  mat4 rows = transpose(light.matrix);
  vec3 x = rows[0].xyz, y = rows[1].xyz;
  vec3 p = (x * (at.x - rows[0].w) + y * (at.y - rows[1].w)) / dot(x, x);
  float along = dot(plane.xyz, key_direction);
  return p + key_direction * (plane.w - dot(plane.xyz, p)) / (abs(along) < 0.02 ? 0.02 : along);
}

// Point i of n that are spread evenly on a disk like the seeds of a sunflower.
vec2 disk_point(int i, int n) {
  float radius = sqrt((float(i) + 0.5) / float(n)), angle = 2.399963 * float(i);
  return radius * vec2(cos(angle), sin(angle));
}

// The part of the key light, with shadows that are softer the farther their caster is (R. Fernando, Percentage-Closer
// Soft Shadows, 2005). The plane itself casts none, so there is no bias.
float key_light(vec3 position) {
  const float light_size = 0.16;  // width of the penumbra over the distance of the caster
  const float widest = 0.024;     // search radius as a part of the shadow map
  vec3 s = light_space(position) * 0.5 + 0.5;
  float metre = 0.5 / light.extent.y, depth = min(s.z, 1.0);
  float narrowest = plane_reach / float(map_size),
        search = clamp(light_size * s.z * light.extent.x * metre, narrowest, widest);
  if (any(lessThan(s.xy, vec2(-search))) || any(greaterThan(s.xy, vec2(1.0 + search)))) return 1.0;
  float blockers = 0.0, sum = 0.0, lit = 0.0;
  for (int i = 0; i < 16; ++i) {
    float d = textureLod(shadow_depth, s.xy + search * disk_point(i, 16), 0.0).r;
    if (d >= depth) continue;
    sum += d;
    blockers += 1.0;
  }
  if (blockers == 0.0) return 1.0;
  if (blockers == 16.0) return 0.0;  // no penumbra is wider than the search
  float gap = max(s.z - sum / blockers, 0.0) * light.extent.x,
        radius = clamp(light_size * gap * metre, narrowest, search);
  for (int i = 0; i < 40; ++i) lit += textureLod(shadow_map, vec3(s.xy + radius * disk_point(i, 40), depth), 0.0);
  return lit / 40.0;
}

// The part of the hemisphere that is hidden by disks, each of which stands for a share of the bodies' triangles. Half
// of their sum counts, since a ray through a body passes two.
float hidden(vec3 at, vec3 normal, uint begin, uint step_size) {
  const uint most = 256u;
  uint disks = min(triangles, most);
  float sum = 0.0;
  for (uint i = begin; i < disks; i += step_size) {
    uint c = 3u * uint(float(i) * (float(triangles) / float(disks)));
    vec3 a = corners[c].position, b = corners[c + 1u].position, e = corners[c + 2u].position;
    vec3 area = 0.5 * cross(b - a, e - a) * (float(triangles) / float(disks)), d = (a + b + e) / 3.0 - at;
    float r2 = max(dot(d, d), 1e-12);
    if (corners[c].kept > 0.0)
      sum += abs(dot(area, d)) * max(dot(normal, d), 0.0) / (r2 * (3.14159 * r2 + length(area)));
  }
  return 0.5 * sum;
}

// The part of the sky that is seen. It varies slowly, so it is found at the corners of the work-group's square and
// interpolated between.
float sky_light(vec4 plane, uvec2 tile, uint lane) {
  uint corner = lane & 3u;
  vec3 at = on_plane(16.0 * (vec2(tile) + vec2(float(corner & 1u), float(corner >> 1u))), plane);
  parts[lane] = hidden(at, plane.xyz, lane >> 2u, 64u);
  for (uint half_size = 128u; half_size >= 4u; half_size /= 2u) {
    barrier();
    if (lane < half_size) parts[lane] += parts[lane + half_size];
  }
  barrier();
  vec2 f = (vec2(gl_LocalInvocationID.xy) + 0.5) / 16.0;
  return 1.0 - min(mix(mix(parts[0], parts[1], f.x), mix(parts[2], parts[3], f.x), f.y), 1.0);
}

void main() {
  uvec3 tile = gl_WorkGroupID;
  vec4 plane = view.planes[tile.z];
  ivec2 texel = ivec2(16u * tile.xy + gl_LocalInvocationID.xy);
  float open = sky_light(plane, tile.xy, gl_LocalInvocationIndex), along = dot(plane.xyz, key_direction);
  // The sky is not darkened at the rim, beyond which nothing is known, and little on planes that the map sees edge-on.
  vec2 rim = abs((vec2(texel) + 0.5) / float(map_size) * 2.0 - 1.0);
  float known = (1.0 - smoothstep(0.7, 0.98, max(rim.x, rim.y))) * smoothstep(0.02, 0.2, abs(along));
  float lit = along > 0.0 ? key_light(on_plane(vec2(texel) + 0.5, plane)) : 1.0;
  imageStore(arrived, texel + ivec2(int(tile.z) * map_size, 0), vec4(lit, mix(1.0, open, known), 0.0, 0.0));
}
