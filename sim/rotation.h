// The best rotation between two sets of points (Kabsch, Acta Cryst. A32, 1976; Horn 1987).
#pragma once

#include <Eigen/Dense>
#include <glm/glm.hpp>

namespace tetpbd {

struct BestRotation {
  glm::dmat3 R{1};
  bool unique = false;  ///< false: several fit as well, of points on a line, in one place or mirrored
};
/// The R with the largest trace(R^T A). With A = sum w x X^T about both centres it turns the points X nearest to x.
inline BestRotation best_rotation(const glm::dmat3& A) {
  const Eigen::Map<const Eigen::Matrix3d> a(&A[0].x);
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(a, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const double sign = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1;
  BestRotation best;
  Eigen::Map<Eigen::Matrix3d>(&best.R[0].x) =
      svd.matrixU() * Eigen::Vector3d(1, 1, sign).asDiagonal() * svd.matrixV().transpose();
  // Turning in the plane of the two smallest values costs their (signed) sum: at 0 any such turn fits as well.
  const Eigen::Vector3d values = svd.singularValues();
  best.unique = values(1) + sign * values(2) > 1e-12 * values(0);
  return best;
}

}  // namespace tetpbd
