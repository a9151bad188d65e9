// SPDX-License-Identifier: Apache-2.0
// Random fundamental matrices for tests.
#pragma once

#include <Eigen/Dense>
#include <random>

#include "calib/camera/calibration.h"
#include "tests/random.h"

namespace silhouette {

// A matrix of rank 2 whose epipoles lie anywhere, in the images too; sometimes affine.
inline Eigen::Matrix3d RandomFundamentalMatrix(std::mt19937_64& random) {
  std::uniform_real_distribution<double> number(-1, 1);
  if (random() % 4 == 0) {
    Eigen::Matrix3d affine = Eigen::Matrix3d::Zero();
    for (auto [row, column] : {std::pair(0, 2), {1, 2}, {2, 0}, {2, 1}, {2, 2}}) {
      affine(row, column) = number(random) * (row + column == 4 ? 8 : 1);
    }
    return affine;
  }
  Eigen::Vector3d epipole(12 * number(random), 12 * number(random), 1);
  Eigen::Matrix3d across;
  across << 0, -1, epipole.y(), 1, 0, -epipole.x(), -epipole.y(), epipole.x(), 0;
  const Eigen::Matrix3d other =
      Eigen::Matrix3d::NullaryExpr([&] { return number(random); }) + Eigen::Matrix3d::Identity();
  return across * other;
}

// Between all pairs of views, but for some that are left out.
inline Calibration RandomCalibration(int views, double left_out, std::mt19937_64& random) {
  Calibration calibration;
  std::bernoulli_distribution leave_out(left_out);
  for (int a = 0; a < views; ++a) {
    for (int b = a + 1; b < views; ++b) {
      if (leave_out(random)) continue;
      const bool turned = random() % 2 == 0;
      calibration.fundamental_matrices.push_back(
          {turned ? b : a, turned ? a : b, RandomFundamentalMatrix(random)});
    }
  }
  return calibration;
}

}  // namespace silhouette
