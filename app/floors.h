// What a dispatch and a byte cost on this GPU at least: what speeds are held against.
#pragma once

namespace tetpbd {

struct Floors {
  double dispatch_us = 0;  ///< a dispatch of as many invocations as a small mesh has, and its barrier
  double copy_gb_s =
      0;  ///< bytes read and written by a kernel that copies, 1e9 a second; from memory, not from a cache
};
/// In the current context; about a tenth of a second.
Floors measure_floors(bool software);

}  // namespace tetpbd
