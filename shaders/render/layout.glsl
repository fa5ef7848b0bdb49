// Binding numbers and uniform blocks of the renderer, read by GLSL and by C++ (render/layout.h). Lengths in metres,
// colours linear.
// Uniform blocks; 0 is the simulation's step.
#define BIND_RENDER_VIEW 1
#define BIND_RENDER_LIGHT 2
// Texture units.
#define UNIT_SHADOW 0        // compared by the sampler
#define UNIT_SHADOW_DEPTH 1  // the same texture as plain depth
#define UNIT_PLANES 2        // what light arrives on planes
#define UNIT_POSITIONS 3     // of vertices that carry a fine surface, and what else of them ...
#define UNIT_TETS 4
#define UNIT_REST 5
#define UNIT_COFACTORS 6
#define UNIT_VALUES 7
#define IMAGE_PLANES 0       // the same, as it is made
// A vertex in a triangle of another body.
struct TouchArrow {
  vec3 from;
  float depth;  // m
  vec3 along;   // unit
  float _0;
};
// Vertex attributes; of the surface HIGH is a corner's place and LOW what is left of it by the cut.
#define ATTRIBUTE_HIGH 0
#define ATTRIBUTE_LOW 1
#define ATTRIBUTE_NORMAL 2
#define ATTRIBUTE_VALUE 3
#define ATTRIBUTE_REST 4
#define ATTRIBUTE_VELOCITY 5
#define ATTRIBUTE_CARRIED 0

#define COLOUR_PLAIN 0
#define COLOUR_VOLUME 1
#define COLOUR_STRETCH 2
#define COLOUR_VELOCITY 3
#define COLOUR_ENERGY 4
#define COLOUR_MOTION 5
#define COLOUR_PATCH 6
#define COLOUR_RESIDUAL 7

#define PALETTE_SIZE 16

struct View {
  mat4 camera;                  // world to clip space
  vec4 eye;                     // w: cosine of the angle between triangles that is an edge; above 1: any is
  vec4 right;                   // of the camera, for the light beside it; w: 1 with shadows
  vec4 colour;                  // COLOUR_..., low and high end of the range; w: edge opacity of the wire view
  vec4 tets;                    // shrink 0..1, explode >= 0; z: 1 where tetrahedra are drawn
  vec4 cut;                     // only the part of the rest shape where dot(xyz, x) <= w is shown
  vec4 material;                // Lame's mu and lambda, Pa; z: which (values.glsl); w: opacity
  vec4 window;                  // the viewport in pixels: lower left, width, height
  vec4 scene;                   // how many planes there are; y: 1 if the first is the ground, on which light bounces
  vec4 planes[MAX_OBSTACLES];   // dot(xyz, x) = w
  vec4 palette[PALETTE_SIZE];   // body colours
};

// Of a triangle of the surface, as it is drawn.
struct SurfaceCorner {
  vec3 position;  // of a triangle that has no place all in one point
  float value;
  uint normal_xy, normal_z_body;  // as 16-bit parts of 1; the body's number over 32767
  float kept;                     // distance from the cut, negative where nothing is left
  float _0;
};

struct Light {
  mat4 matrix;  // world to the shadow map's clip space
  vec4 centre;  // of the bodies' bounds; w: size of a texel in metres
  vec4 extent;  // x: depth range in metres; y: half the width of the map in metres
};
