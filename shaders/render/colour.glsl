// Colour maps as linear sRGB, compiled as GLSL and as C++. They are straight lines and arcs in OKLab (B. Ottosson,
// 2020), where equal steps look equally large.

vec3 oklab_to_linear(vec3 lab) {
  float l = lab.x + 0.3963377774f * lab.y + 0.2158037573f * lab.z;
  float m = lab.x - 0.1055613458f * lab.y - 0.0638541728f * lab.z;
  float s = lab.x - 0.0894841775f * lab.y - 1.2914855480f * lab.z;
  l = l * l * l;
  m = m * m * m;
  s = s * s * s;
  return vec3(4.0767416621f * l - 3.3077115913f * m + 0.2309699292f * s,
              -1.2684380046f * l + 2.6097574011f * m - 0.3413193965f * s,
              -0.0041960863f * l - 0.7034186147f * m + 1.7076147010f * s);
}

// From blue at -1 over near white at 0 to red at 1. Lightness falls equally to both sides: neither sign looks larger.
vec3 diverging_colour(float t) {
  t = clamp(t, -1.0f, 1.0f);
  float a = abs(t);
  float lightness = mix(0.955f, 0.50f, a * (0.55f + 0.45f * a));
  float chroma = 0.165f * a * (1.75f - 0.75f * a);
  float hue = t < 0.0f ? mix(4.30f, 4.52f, a) : mix(0.85f, 0.50f, a);  // radians
  return clamp(oklab_to_linear(vec3(lightness, chroma * cos(hue), chroma * sin(hue))), vec3(0.0f), vec3(1.0f));
}

// From dark violet at 0 over blue-green to yellow at 1. Lightness grows evenly, so that it also reads in grey.
vec3 sequential_colour(float t) {
  t = clamp(t, 0.0f, 1.0f);
  float lightness = mix(0.30f, 0.91f, t);
  float hue = mix(5.35f, 1.80f, t * (0.75f + 0.25f * t));  // radians
  float chroma = 0.125f + 0.045f * t * t;
  return clamp(oklab_to_linear(vec3(lightness, chroma * cos(hue), chroma * sin(hue))), vec3(0.0f), vec3(1.0f));
}

// The colour of a number; successive numbers are far apart in hue.
vec3 number_colour(float number) {
  float hue = 2.399963f * number, lightness = 0.62f + 0.06f * sin(1.7f * number);  // radians, the golden angle
  return clamp(oklab_to_linear(vec3(lightness, 0.11f * cos(hue), 0.11f * sin(hue))), vec3(0.0f), vec3(1.0f));
}

// The colour of `value` on a scale from `low` to `high`. Kinds 1 (volume) and 2 (stretch) are signed, 6 (patch) counts.
vec3 scale_colour(int kind, float value, float low, float high) {
  if (kind == 6) return number_colour(value);
  float t = (value - low) / (high - low);
  return kind >= 3 ? sequential_colour(t) : diverging_colour(2.0f * t - 1.0f);
}
