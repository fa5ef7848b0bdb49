#include "render/view.glsl"
#include "render/light.glsl"
layout(location = 0) out vec4 result;
void main() { result = vec4(background_colour(gl_FragCoord.y), 1.0); }
