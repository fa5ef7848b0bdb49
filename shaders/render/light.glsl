// Material, lights and shadows. Colours are linear, and irradiances are over pi, so that a white face is about 1.
layout(binding = UNIT_SHADOW) uniform sampler2DShadow shadow_map;
layout(binding = UNIT_SHADOW_DEPTH) uniform sampler2D shadow_depth;
layout(binding = UNIT_PLANES) uniform sampler2D plane_light;

const vec3 key_colour = vec3(0.75, 0.715, 0.665);
const vec3 sky_colour = vec3(0.425, 0.45, 0.485);
const float bounced = 0.34;     // part of the light that the ground reflects
const float roughness = 0.3;    // GGX's alpha of the bodies
const float mirrored = 0.04;    // reflectance of plastic, seen head on
const float plane_reach = 1.5;  // size of the maps of planes over that of the shadow map

vec3 background_colour(float y) {
  const vec3 low = vec3(0.815, 0.810, 0.800), high = vec3(0.620, 0.670, 0.720);
  return mix(low, high, smoothstep(0.0, 1.0, (y - view.window.y) / view.window.w));
}

vec3 light_space(vec3 position) { return (light.matrix * vec4(position, 1.0)).xyz; }

// The parts of the key light and of the sky that arrive at a point of a plane, as plane_light.comp found them.
vec2 arriving(vec3 position, float plane) {
  if (view.right.w == 0.0) return vec2(1.0);
  vec2 at = light_space(position).xy / plane_reach;
  if (any(greaterThan(abs(at), vec2(1.0)))) return vec2(1.0);
  return textureLod(plane_light, vec2((at.x * 0.5 + 0.5 + plane) / view.scene.x, at.y * 0.5 + 0.5), 0.0).rg;
}

// The part of the key light that arrives on a body, from four filtered samples of the shadow map. The compared point is
// moved off the surface by more than they are apart, which keeps a surface from shadowing itself.
float body_shadow(vec3 position, vec3 normal, float facing) {
  if (view.right.w == 0.0) return 1.0;
  vec3 s = light_space(position + normal * light.centre.w * (1.0 + 1.5 * (1.0 - facing))) * 0.5 + 0.5;
  s.z = min(s.z - 0.5 * light.centre.w / light.extent.x, 1.0);
  const vec2 around[4] = vec2[](vec2(-0.4, -1.0), vec2(1.0, -0.4), vec2(0.4, 1.0), vec2(-1.0, 0.4));
  float texel = 0.5 * light.centre.w / light.extent.y, lit = 0.0;
  for (int i = 0; i < 4; ++i) lit += texture(shadow_map, vec3(s.xy + texel * around[i], s.z));
  return 0.25 * lit;
}

// The light that arrives on the ground below. The higher the position, the smaller a part of the visible ground is the
// point right below it.
vec2 below(vec3 position) {
  if (view.scene.y == 0.0 || view.right.w == 0.0) return vec2(1.0);
  vec4 ground = view.planes[0];
  float height = max(dot(ground.xyz, position) - ground.w, 0.0);
  return mix(arriving(position - height * ground.xyz, 0.0), vec2(1.0),
             height / (height + 0.35 * light.extent.y + 1e-6));
}

// Light from the surroundings, of which `sky` is the part that the sky takes up and the ground the rest.
vec3 surroundings(float sky, vec2 on_ground) {
  return mix(bounced * (key_direction.y * key_colour * on_ground.x + sky_colour * on_ground.y), sky_colour, sky);
}

// The colour of a body of dull plastic (GGX in B. Karis's form for mobile GPUs) under the key light, sky and ground,
// and a little light beside the camera. Colours that show values are not `shiny` and keep their hue under white light.
vec3 shade(vec3 albedo, vec3 position, vec3 normal, bool shiny) {
  vec3 to_eye = normalize(view.eye.xyz - position);
  float facing = dot(normal, key_direction), key = max(facing, 0.0);
  if (key > 0.0) key *= body_shadow(position, normal, key);
  vec2 on_ground = below(position);
  float beside = 0.16 * max(dot(normal, normalize(to_eye - 0.7 * view.right.xyz + vec3(0.0, 0.25, 0.0))), 0.0);
  // The sky is brighter where the key light is.
  vec3 received = key_colour * key + (1.0 + 0.25 * facing) * surroundings(0.5 + 0.5 * normal.y, on_ground) + beside;
  if (!shiny) return 0.88 * albedo * dot(received, vec3(0.30, 0.59, 0.11));
  vec3 middle = normalize(key_direction + to_eye);
  float at = max(dot(normal, middle), 0.0), across = dot(key_direction, middle), a2 = roughness * roughness;
  float lobe = 1.0 + (a2 - 1.0) * at * at;
  float highlight = mirrored * a2 / (4.0 * lobe * lobe * max(0.1, across * across) * (roughness + 0.5));
  float grazing = pow(1.0 - clamp(dot(normal, to_eye), 0.0, 1.0), 5.0);
  vec3 around = surroundings(smoothstep(-0.4, 0.4, reflect(-to_eye, normal).y), on_ground);
  return albedo * received + key_colour * key * highlight + (mirrored + 0.3 * grazing) * around;
}
