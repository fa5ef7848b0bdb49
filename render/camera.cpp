#include "sim/gpu.h"
