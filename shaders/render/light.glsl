// Lighting and shadows. All colours linear.
layout(binding = UNIT_SHADOW) uniform sampler2DShadow shadow_map;
layout(binding = UNIT_SHADOW_DEPTH) uniform sampler2D shadow_depth;

const vec3 key_colour = vec3(2.20, 2.10, 1.95);
const vec3 sky_colour = vec3(0.62, 0.68, 0.76);
const vec3 bounce_colour = vec3(0.36, 0.33, 0.30);

// Point i of n on a disk, evenly spread (sunflower).
vec2 disk_point(int i, int n) {
  float radius = sqrt((float(i) + 0.5) / float(n));
  float angle = 2.399963 * float(i);
  return radius * vec2(cos(angle), sin(angle));
}

vec3 shadow_coordinates(vec3 position) { return (light.matrix * vec4(position, 1.0)).xyz * 0.5 + 0.5; }

bool outside_map(vec3 s) { return any(lessThan(s.xy, vec2(0.0))) || any(greaterThan(s.xy, vec2(1.0))); }

float filtered(vec3 s, float radius, int n) {
  float lit = 0.0;
  for (int i = 0; i < n; ++i) lit += texture(shadow_map, vec3(s.xy + radius * disk_point(i, n), s.z));
  return lit / float(n);
}

// Part of the key light that arrives on a body. The point compared is moved off the surface by more than the filter is
// wide, which is what keeps a surface from shadowing itself.
float body_shadow(vec3 position, vec3 normal) {
  if (view.right.w == 0.0) return 1.0;
  float slope = 1.0 - clamp(dot(normal, key_direction), 0.0, 1.0);
  vec3 s = shadow_coordinates(position + normal * light.centre.w * (1.0 + 2.5 * slope));
  if (outside_map(s)) return 1.0;
  return filtered(vec3(s.xy, s.z - 0.5 * light.centre.w / light.extent.x), 2.5 * 0.5 * light.centre.w / light.extent.y, 16);
}

// The same on a plane that casts no shadow itself, so it needs no bias: sharp at the contact, softer with the distance
// from what casts it (R. Fernando, Percentage-Closer Soft Shadows, 2005).
float plane_shadow(vec3 position) {
  if (view.right.w == 0.0) return 1.0;
  vec3 s = shadow_coordinates(position);
  float texel = 0.5 * light.centre.w / light.extent.y;
  const float light_size = 0.16;  // widening of the penumbra in metres for each metre
  float search = min(light_size * max(s.z, 0.0) * light.extent.x * 0.5 / light.extent.y, 28.0 * texel);
  if (any(lessThan(s.xy, vec2(-search))) || any(greaterThan(s.xy, vec2(1.0 + search)))) return 1.0;
  float blockers = 0.0, depth = 0.0;
  for (int i = 0; i < 24; ++i) {
    float d = texture(shadow_depth, s.xy + max(search, 2.0 * texel) * disk_point(i, 24)).r;
    if (d < min(s.z, 1.0)) {
      depth += d;
      blockers += 1.0;
    }
  }
  if (blockers == 0.0) return 1.0;
  float gap = max(s.z - depth / blockers, 0.0) * light.extent.x;
  float radius = clamp(light_size * gap * 0.5 / light.extent.y, 1.5 * texel, 28.0 * texel);
  return filtered(vec3(s.xy, min(s.z, 1.0)), radius, 48);
}

vec3 shade(vec3 albedo, vec3 position, vec3 normal, float key_light) {
  vec3 to_eye = normalize(view.eye.xyz - position);
  float facing = dot(normal, key_direction);
  // Wrapped a little past the terminator: the soft look of a large lamp.
  float key = max((facing + 0.15) / 1.15, 0.0);
  key *= mix(smoothstep(-0.15, 0.25, facing), 1.0, 0.35) * key_light;
  vec3 ambient = mix(bounce_colour, sky_colour, 0.5 + 0.5 * normal.y);
  vec3 beside = normalize(to_eye - 0.7 * view.right.xyz + vec3(0.0, 0.25, 0.0));
  float fill = 0.22 * max(dot(normal, beside), 0.0);
  vec3 colour = albedo * (key_colour * key * 0.36 + ambient * 0.62 + fill);
  float highlight = pow(max(dot(normal, normalize(key_direction + to_eye)), 0.0), 36.0);
  float rim = pow(1.0 - clamp(dot(normal, to_eye), 0.0, 1.0), 4.0);
  return colour + 0.10 * highlight * key_light * step(0.0, facing) * key_colour + 0.10 * rim * sky_colour;
}
