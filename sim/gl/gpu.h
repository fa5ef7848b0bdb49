// The little OpenGL 4.3 core that this program needs: a context, buffers, programs with includes, fences and
// timers. Move-only, labelled and counted; no direct state access, no buffer storage, no vendor extension.
// Nothing here knows of meshes or solvers. Whatever else is asked of a driver is a row of Capabilities.
#pragma once

#include "sim/gl/buffer.h"
#include "sim/gl/context.h"
#include "sim/gl/program.h"
#include "sim/gl/timer.h"
