#include "app/window.h"

#include "sim/error.h"

namespace tetpbd {

int run_window(const Scene&, const WindowOptions&) { throw Error("no window yet", "view", "use tetpbd run"); }

}  // namespace tetpbd
