// SPDX-License-Identifier: Apache-2.0
#include "calib/camera/common_field.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>
#include <random>
#include <vector>

namespace silhouette {
namespace {

constexpr double kNoise = 0.1;  // pixels

constexpr int kImages = 60;
constexpr int kPoints = 40;
constexpr int kRows = 2 * kImages * kPoints;

// 60 images of 40 points in a camera whose state is a shift of all pixels. Standard deviations of
// the knots' shifts, pixels: `field`, that all images share; `own`, that each has by itself.
SolvedResiduals SolvedWith(unsigned seed, double field, double own) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0, 1);
  std::uniform_real_distribution<double> uniform(0, 1);
  const auto draw = [&](double sigma) {
    Eigen::VectorXd shifts(2 * kFieldKnots);
    for (double& shift : shifts) shift = sigma * normal(random);
    return shifts;
  };
  const Eigen::VectorXd of_all = draw(field);
  std::vector<Eigen::Triplet<double>> by_state;
  std::vector<Eigen::Triplet<double>> by_field;
  SolvedResiduals solved;
  solved.residuals.resize(kRows);
  for (int row = 0; row < kRows;) {
    solved.clusters.emplace_back();
    const Eigen::VectorXd shifts = of_all + draw(own);
    for (int point = 0; point < kPoints; ++point) {
      const auto knots = KnotsAt({640 * uniform(random), 480 * uniform(random)}, 640, 480);
      for (int axis = 0; axis < 2; ++axis, ++row) {
        solved.clusters.back().push_back(row);
        solved.residuals[row] = kNoise * normal(random);
        by_state.emplace_back(row, axis, 1);
        for (const KnotShare& knot : knots) {
          by_field.emplace_back(row, 2 * knot.knot + axis, knot.share);
          solved.residuals[row] += knot.share * shifts[2 * knot.knot + axis];
        }
      }
    }
  }
  solved.by_state.resize(kRows, 2);
  solved.by_state.setFromTriplets(by_state.begin(), by_state.end());
  solved.by_field.resize(kRows, 2 * kFieldKnots);
  solved.by_field.setFromTriplets(by_field.begin(), by_field.end());
  const Eigen::Matrix2d covariance =
      Eigen::MatrixXd(solved.by_state.transpose() * solved.by_state).inverse();
  const Eigen::Vector2d state = covariance * (solved.by_state.transpose() * solved.residuals);
  solved.residuals -= solved.by_state * state;
  solved.covariance_times = [=](const Eigen::MatrixXd& x) -> Eigen::MatrixXd {
    return covariance * x;
  };
  solved.root_times = [=](size_t, const Eigen::MatrixXd& x) -> Eigen::MatrixXd {
    return covariance.llt().matrixU() * x;
  };
  return solved;
}

OwnFields OwnFieldsOf(const SolvedResiduals& solved) { return FindOwnFields(solved, kRows - 2); }

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

TEST(OwnFields, NoiseAndTheErrorsOfEachImageAreToldApart) {
  const OwnFields own = OwnFieldsOf(SolvedWith(1, 0, 0.1));
  EXPECT_NEAR(std::sqrt(own.noise), kNoise, 0.003);
  EXPECT_NEAR(own.sigma, 0.1, 0.005);
}

TEST(OwnFields, NoiseAloneHasHardlyAny) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const OwnFields own = OwnFieldsOf(SolvedWith(seed, 0, 0));
    EXPECT_NEAR(std::sqrt(own.noise), kNoise, 0.003) << seed;
    EXPECT_LT(own.sigma, 0.03) << seed;
  }
}

TEST(OwnFields, WithoutAnyErrorThereAreNone) {
  SolvedResiduals solved = SolvedWith(1, 0, 0);
  solved.residuals.setZero();
  const OwnFields own = OwnFieldsOf(solved);
  EXPECT_EQ(own.noise, 0);
  EXPECT_EQ(own.sigma, 0);
}

TEST(CommonField, ItsSizeIsFoundBesideErrorsThatEachImageHasByItself) {
  for (const double own : {0.0, 0.1}) {
    const SolvedResiduals solved = SolvedWith(1, 0.08, own);
    const auto found = FindCommonField(solved, OwnFieldsOf(solved));
    ASSERT_TRUE(found.has_value()) << own;
    EXPECT_NEAR(found->sigma, 0.08, 0.025) << own;
  }
}

TEST(CommonField, ErrorsThatEachImageHasByItselfAreNone) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    for (const double own : {0.0, 0.2}) {
      const SolvedResiduals solved = SolvedWith(seed, 0, own);
      EXPECT_FALSE(FindCommonField(solved, OwnFieldsOf(solved)).has_value()) << seed;
    }
  }
}

}  // namespace
}  // namespace silhouette
