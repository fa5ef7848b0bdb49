// Binding numbers and uniform blocks of the renderer, read by GLSL and by C++ (render/layout.h). Lengths in metres,
// colours linear. Storage bindings overlap the simulation's: 8 is all that GL 4.3 guarantees, so each side binds its
// own buffers before it dispatches.
#define BIND_RENDER_POSITIONS 0
#define BIND_RENDER_REST 1
#define BIND_RENDER_OFFSETS 3  // where a vertex's items begin; one more at the end
#define BIND_RENDER_ITEMS 4
#define BIND_RENDER_ANSWERS 4  // where vertices should be, or their velocities
#define BIND_RENDER_VALUES 5
#define BIND_RENDER_BOUNDS 6
#define BIND_RENDER_FIT 7
#define BIND_PICK_TRIANGLES 1
#define BIND_PICK_RESULT 2
#define BIND_PICK_REST 3
// Uniform blocks; 0 is the simulation's step.
#define BIND_RENDER_VIEW 1
#define BIND_RENDER_LIGHT 2
// Texture units.
#define UNIT_SHADOW 0        // compared by the sampler
#define UNIT_SHADOW_DEPTH 1  // the same texture as plain depth
// Vertex attributes.
#define ATTRIBUTE_HIGH 0
#define ATTRIBUTE_LOW 1
#define ATTRIBUTE_NORMAL 2
#define ATTRIBUTE_VALUE 3
#define ATTRIBUTE_REST 4
#define ATTRIBUTE_VELOCITY 5

#define COLOUR_PLAIN 0
#define COLOUR_VOLUME 1
#define COLOUR_STRETCH 2
#define COLOUR_VELOCITY 3
#define COLOUR_ENERGY 4
#define COLOUR_MOTION 5
#define COLOUR_PATCH 6

#define PALETTE_SIZE 16

struct View {
  mat4 camera;                  // world to clip space
  vec4 eye;                     // w: 1 with smooth normals, 0 with flat ones
  vec4 right;                   // of the camera, for the light beside it; w: 1 with shadows
  vec4 colour;                  // COLOUR_..., low and high end of the range; w: edge opacity of the wire view
  vec4 tets;                    // shrink 0..1, explode >= 0; z: 1 where tetrahedra are drawn
  vec4 cut;                     // only the part of the rest shape where dot(xyz, x) <= w is shown
  vec4 material;                // Lame's mu and lambda, Pa; z: which (values.glsl); w: opacity
  vec4 palette[PALETTE_SIZE];   // body colours
};

struct Light {
  mat4 matrix;  // world to the shadow map's clip space
  vec4 centre;  // of the bodies' bounds; w: size of a texel in metres
  vec4 extent;  // x: depth range in metres; y: half the width of the map in metres
};
