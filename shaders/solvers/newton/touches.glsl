// Which bodies press which, in bits by body.
#define TOUCH_WORDS ((BODIES + 31u) / 32u)
layout(std430) restrict buffer Touches { uint touches[]; };
