// The rotation that fits best (Kabsch, Acta Cryst. A32, 1976; Horn 1987).
#pragma once

#include <glm/glm.hpp>

namespace tetpbd {

struct BestRotation {
  glm::dmat3 R{1};
  bool unique = false;  ///< false: points on a line, in one place or mirrored allow several
};
/// The R with the largest trace(R^T A), for A = sum w x X^T about both centres: it turns the X nearest to the
/// x.
BestRotation best_rotation(const glm::dmat3& A);

}  // namespace tetpbd
