// SPDX-License-Identifier: Apache-2.0
#include "calib/poses/variance_components.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

namespace silhouette {
namespace {

constexpr int kGroups = 200;
constexpr int kMembers = 10;
constexpr int kMeasurements = kGroups * kMembers;

// The mean of measurements in groups: each has noise of its own, each group a shift.
struct GroupedMean {
  GroupedMean(unsigned seed, double noise, double shift) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal(0, 1);
    solved.jacobian.resize(kMeasurements, 1);
    solved.inverse = Eigen::MatrixXd::Constant(1, 1, 1.0 / kMeasurements);
    solved.residuals.resize(kMeasurements);
    parts.assign(2, {});
    parts[0].by_shift.resize(kMeasurements, kMeasurements);
    parts[1].by_shift.resize(kMeasurements, kGroups);
    double of_group = 0;
    for (int row = 0; row < kMeasurements; ++row) {
      if (row % kMembers == 0) of_group = shift * normal(random);
      solved.residuals[row] = of_group + noise * normal(random);
      solved.jacobian.insert(row, 0) = 1;
      parts[0].by_shift.insert(row, row) = 1;
      parts[1].by_shift.insert(row, row / kMembers) = 1;
    }
    error = solved.residuals.mean();
    solved.residuals.array() -= error;
  }

  LeastSquares solved;
  std::vector<ErrorPart> parts;  // noise, shifts
  double error = 0;              // of the mean
};

TEST(VarianceComponents, NoiseAndTheShiftsOfGroupsAreToldApart) {
  GroupedMean mean(1, 0.5, 0.2);
  const Eigen::MatrixXd covariance = CovarianceByParts(mean.solved, mean.parts);
  EXPECT_NEAR(std::sqrt(*mean.parts[0].variance), 0.5, 0.02);
  EXPECT_NEAR(std::sqrt(*mean.parts[1].variance), 0.2, 0.03);
  EXPECT_NEAR(covariance(0, 0),
              *mean.parts[0].variance / kMeasurements + *mean.parts[1].variance / kGroups, 1e-12);
}

TEST(VarianceComponents, AnErrorIsAsLargeAsItsCovarianceSays) {
  constexpr int kRuns = 100;
  double squares = 0;
  for (unsigned seed = 1; seed <= kRuns; ++seed) {
    GroupedMean mean(seed, 0.5, 0.2);
    squares += mean.error * mean.error / CovarianceByParts(mean.solved, mean.parts)(0, 0);
  }
  EXPECT_NEAR(squares / kRuns, 1, 0.4);
}

TEST(VarianceComponents, NoiseAloneHasHardlyAnyShiftsAndNeverLessThanNone) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    GroupedMean mean(seed, 0.5, 0);
    CovarianceByParts(mean.solved, mean.parts);
    EXPECT_NEAR(std::sqrt(*mean.parts[0].variance), 0.5, 0.03) << seed;
    EXPECT_GE(*mean.parts[1].variance, 0) << seed;
    EXPECT_LT(std::sqrt(*mean.parts[1].variance), 0.1) << seed;
  }
}

TEST(VarianceComponents, AVarianceThatIsKnownStaysAndTheOthersAreFoundBesideIt) {
  GroupedMean mean(1, 0.5, 0.2);
  mean.parts[0].variance = 0.25;
  CovarianceByParts(mean.solved, mean.parts);
  EXPECT_EQ(*mean.parts[0].variance, 0.25);
  EXPECT_NEAR(std::sqrt(*mean.parts[1].variance), 0.2, 0.03);
}

TEST(VarianceComponents, PartsThatMoveNothingHaveNoErrors) {
  GroupedMean mean(1, 0.5, 0);
  mean.parts[1].by_shift.setZero();
  EXPECT_NEAR(CovarianceByParts(mean.solved, mean.parts)(0, 0), 0.25 / kMeasurements,
              0.02 / kMeasurements);
}

}  // namespace
}  // namespace silhouette
