// The little OpenGL 4.3 core that this program needs: a context, buffers, programs with includes, fences and
// timers, all labelled and counted. No direct state access, no buffer storage, no vendor extension: what more
// is asked of a driver is a row of Capabilities. Nothing here knows of meshes or solvers.
#pragma once

#include "sim/gl/buffer.h"
#include "sim/gl/context.h"
#include "sim/gl/program.h"
#include "sim/gl/timer.h"
