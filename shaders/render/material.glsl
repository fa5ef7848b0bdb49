// What a body is made of, by its number: as energy.glsl has it, with w for tet_residual(). A single one is that of all.
layout(binding = UNIT_MATERIALS) uniform samplerBuffer body_materials;
vec4 body_material(float body) {
  return texelFetch(body_materials, min(int(body), textureSize(body_materials) - 1));
}
