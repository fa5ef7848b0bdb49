// Binding numbers and blocks of the renderer, read by GLSL and by C++ (render/layout.h). Lengths are in metres, colours
// linear. Of uniform blocks, 0 is the simulation's step.
#define BIND_RENDER_VIEW 1
#define BIND_RENDER_LIGHT 2
// Texture units.
#define UNIT_SHADOW 0        // compared by the sampler
#define UNIT_SHADOW_DEPTH 1  // the same texture as plain depth
#define UNIT_PLANES 2        // the light that arrives on planes
#define UNIT_POSITIONS 3     // from here on of the tets with an embedded surface
#define UNIT_TETS 4
#define UNIT_REST 5
#define UNIT_COFACTORS 6
#define UNIT_VALUES 7
#define UNIT_MATERIALS 8     // of bodies
#define IMAGE_PLANES 0       // UNIT_PLANES while it is made
// A contact of a vertex or an edge with another body.
struct ContactArrow {
  vec3 from;
  float depth;  // m
  vec3 along;   // unit
  float _0;
};
// Vertex attributes. Of a SurfaceCorner, HIGH is its position and LOW what it has `kept`.
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
  vec4 eye;                     // w: triangles at a larger angle than this cosine's make a sharp edge; above 1: all do
  vec4 right;                   // of the camera, for the light beside it; w: 1 with shadows
  vec4 colour;                  // COLOUR_..., low and high end of the range; w: edge opacity of the wire view
  vec4 tets;                    // shrink 0..1, explode >= 0; z: 1 where tets are drawn
  vec4 cut;                     // only the part of the rest shape where dot(xyz, x) <= w is shown
  vec4 window;                  // the viewport in pixels: lower left, width, height
  vec4 scene;                   // x: number of planes; y: 1 if the first is the ground, from which light bounces;
                                // z: opacity of bodies
  vec4 planes[MAX_OBSTACLES];   // dot(xyz, x) = w
  vec4 palette[PALETTE_SIZE];   // body colours
};

// A corner of a triangle of the surface, as it is drawn.
struct SurfaceCorner {
  vec3 position;  // of a triangle that is not finite, all three are 0
  float value;
  uint normal_xy, normal_z_body;  // in 16-bit parts of 1, as the body's number over 32767
  float kept;                     // m, distance from the cut, negative beyond it
  float _0;
};

struct Light {
  mat4 matrix;  // world to the shadow map's clip space
  vec4 centre;  // of the bodies' bounds; w: size of a texel in metres
  vec4 extent;  // x: depth range in metres; y: half the width of the map in metres
};
