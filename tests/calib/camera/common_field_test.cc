// SPDX-License-Identifier: Apache-2.0
#include "calib/camera/common_field.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <optional>
#include <random>
#include <vector>

namespace silhouette {
namespace {

constexpr double kNoise = 0.1;  // pixels

// 60 images of 40 points in a camera whose state is a shift of all pixels. `field`: of the
// knots' shifts; `own`: of a shift that each image has by itself; standard deviations, pixels.
std::optional<FoundField> FieldOf(unsigned seed, double field, double own) {
  constexpr int kImages = 60;
  constexpr int kPoints = 40;
  constexpr int kRows = 2 * kImages * kPoints;
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0, 1);
  std::uniform_real_distribution<double> uniform(0, 1);
  Eigen::VectorXd shifts(2 * kFieldKnots);
  for (double& shift : shifts) shift = field * normal(random);
  std::vector<Eigen::Triplet<double>> by_state;
  std::vector<Eigen::Triplet<double>> by_field;
  SolvedResiduals solved;
  solved.residuals.resize(kRows);
  for (int row = 0; row < kRows;) {
    solved.clusters.emplace_back();
    const Eigen::Vector2d of_image(own * normal(random), own * normal(random));
    for (int point = 0; point < kPoints; ++point) {
      const auto knots = KnotsAt({640 * uniform(random), 480 * uniform(random)}, 640, 480);
      for (int axis = 0; axis < 2; ++axis, ++row) {
        solved.clusters.back().push_back(row);
        solved.residuals[row] = kNoise * normal(random) + of_image[axis];
        by_state.emplace_back(row, axis, 1);
        for (const KnotShare& knot : knots) {
          by_field.emplace_back(row, 2 * knot.knot + axis, knot.share);
        }
      }
    }
  }
  solved.by_state.resize(kRows, 2);
  solved.by_state.setFromTriplets(by_state.begin(), by_state.end());
  solved.by_field.resize(kRows, 2 * kFieldKnots);
  solved.by_field.setFromTriplets(by_field.begin(), by_field.end());
  solved.residuals += solved.by_field * shifts;
  const Eigen::Matrix2d covariance =
      Eigen::MatrixXd(solved.by_state.transpose() * solved.by_state).inverse();
  const Eigen::Vector2d state = covariance * (solved.by_state.transpose() * solved.residuals);
  solved.residuals -= solved.by_state * state;
  solved.variance = kNoise * kNoise + own * own;
  solved.covariance_times = [=](const Eigen::MatrixXd& x) -> Eigen::MatrixXd {
    return covariance * x;
  };
  solved.trace = [=](size_t, const Eigen::MatrixXd& x) {
    return x.cwiseProduct(covariance * x).sum();
  };
  return FindCommonField(solved);
}

TEST(CommonField, AWholePixelIsSharedByItsKnots) {
  for (const Eigen::Vector2d& pixel :
       {Eigen::Vector2d(-0.5, -0.5), Eigen::Vector2d(639.5, 479.5), Eigen::Vector2d(100, 300)}) {
    double sum = 0;
    for (const KnotShare& knot : KnotsAt(pixel, 640, 480)) {
      EXPECT_GE(knot.share, 0);
      EXPECT_LT(knot.knot, kFieldKnots);
      sum += knot.share;
    }
    EXPECT_NEAR(sum, 1, 1e-12);
  }
}

TEST(CommonField, ItsSizeIsFoundBesideErrorsThatEachImageHasByItself) {
  for (const double own : {0.0, 0.1}) {
    const auto found = FieldOf(1, 0.08, own);
    ASSERT_TRUE(found.has_value()) << own;
    EXPECT_NEAR(found->sigma, 0.08, 0.025) << own;
  }
}

TEST(CommonField, ErrorsThatEachImageHasByItselfAreNone) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    EXPECT_FALSE(FieldOf(seed, 0, 0).has_value()) << seed;
    EXPECT_FALSE(FieldOf(seed, 0, 0.2).has_value()) << seed;
  }
}

}  // namespace
}  // namespace silhouette
