// SPDX-License-Identifier: Apache-2.0
#include "calib/poses/variance_components.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <optional>
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
    parts[0].resize(kMeasurements, kMeasurements);
    parts[1].resize(kMeasurements, kGroups);
    double of_group = 0;
    for (int row = 0; row < kMeasurements; ++row) {
      if (row % kMembers == 0) of_group = shift * normal(random);
      solved.residuals[row] = of_group + noise * normal(random);
      solved.jacobian.insert(row, 0) = 1;
      parts[0].insert(row, row) = 1;
      parts[1].insert(row, row / kMembers) = 1;
    }
    error = solved.residuals.mean();
    solved.residuals.array() -= error;
  }

  // `noise`: its variance, if it is known.
  Eigen::VectorXd Variances(std::optional<double> noise = std::nullopt) const {
    return VarianceComponents(solved, parts).Variances(solved.residuals, {noise, std::nullopt});
  }
  // Of the mean.
  double Variance() const {
    return VarianceComponents(solved, parts).Covariance(Variances(), 0, 1)(0, 0);
  }

  LeastSquares solved;
  std::vector<ErrorRows> parts;  // noise, shifts
  double error = 0;              // of the mean
};

TEST(VarianceComponents, NoiseAndTheShiftsOfGroupsAreToldApart) {
  const GroupedMean mean(1, 0.5, 0.2);
  const Eigen::VectorXd variances = mean.Variances();
  EXPECT_NEAR(std::sqrt(variances[0]), 0.5, 0.02);
  EXPECT_NEAR(std::sqrt(variances[1]), 0.2, 0.03);
  EXPECT_NEAR(mean.Variance(), variances[0] / kMeasurements + variances[1] / kGroups, 1e-12);
}

TEST(VarianceComponents, AnErrorIsAsLargeAsItsCovarianceSays) {
  constexpr int kRuns = 100;
  double squares = 0;
  for (unsigned seed = 1; seed <= kRuns; ++seed) {
    const GroupedMean mean(seed, 0.5, 0.2);
    squares += mean.error * mean.error / mean.Variance();
  }
  EXPECT_NEAR(squares / kRuns, 1, 0.4);
}

TEST(VarianceComponents, NoiseAloneHasHardlyAnyShiftsAndNeverLessThanNone) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    const Eigen::VectorXd variances = GroupedMean(seed, 0.5, 0).Variances();
    EXPECT_NEAR(std::sqrt(variances[0]), 0.5, 0.03) << seed;
    EXPECT_GE(variances[1], 0) << seed;
    EXPECT_LT(std::sqrt(variances[1]), 0.1) << seed;
  }
}

TEST(VarianceComponents, AVarianceThatIsKnownStaysAndTheOthersAreFoundBesideIt) {
  const Eigen::VectorXd variances = GroupedMean(1, 0.5, 0.2).Variances(0.25);
  EXPECT_EQ(variances[0], 0.25);
  EXPECT_NEAR(std::sqrt(variances[1]), 0.2, 0.03);
}

TEST(VarianceComponents, PartsThatMoveNothingHaveNoErrors) {
  GroupedMean mean(1, 0.5, 0);
  mean.parts[1].setZero();
  EXPECT_NEAR(mean.Variance(), 0.25 / kMeasurements, 0.02 / kMeasurements);
}

// With a part of more shifts than states and one of fewer.
TEST(VarianceComponents, SumsOfStepsHaveTheChi2OfUnknownsThatAreFoundSingly) {
  constexpr int kSteps = 5;
  constexpr int kRows = 40;
  const auto random = [](int rows, int columns) {
    return Eigen::MatrixXd::Random(rows, columns).eval();
  };
  const Eigen::MatrixXd jacobian = random(kRows, 4);
  const Eigen::MatrixXd inverse = (jacobian.transpose() * jacobian).inverse();
  const Eigen::VectorXd errors = random(kRows, 1);
  const VarianceComponents components(
      {.jacobian = ErrorRows(jacobian.sparseView()),
       .inverse = inverse,
       .residuals = errors - jacobian * inverse * jacobian.transpose() * errors},
      {ErrorRows(random(kRows, 20).sparseView()), ErrorRows(random(kRows, 3).sparseView())});
  const Eigen::Vector2d variances(0.5, 2);
  std::vector<Eigen::SparseMatrix<double>> steps;
  for (int i = 0; i < kSteps; ++i) steps.emplace_back(random(kRows, 2).sparseView());
  const std::vector<double> chi2 = components.Chi2FromEachOn(steps, variances);
  for (size_t i = 0; i < steps.size(); ++i) {
    ErrorRows sum(kRows, 2);
    for (size_t k = i; k < steps.size(); ++k) sum += ErrorRows(steps[k]);
    EXPECT_NEAR(chi2[i], components.Find(sum, variances).Chi2(0, 2), 1e-9 * chi2[i]) << i;
  }
}

}  // namespace
}  // namespace silhouette
