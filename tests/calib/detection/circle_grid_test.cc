// SPDX-License-Identifier: Apache-2.0
// The middles of circles against where they really are, in rendered images.
#include "calib/detection/circle_grid.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <cmath>
#include <opencv2/core.hpp>

#include "tests/calib/detection/rendered_board.h"

namespace silhouette {
namespace {

Board Circles(int columns, int rows, bool asymmetric) {
  return Board({.name = "dots",
                .kind = BoardKind::kCircles,
                .rows = rows,
                .columns = columns,
                .square = asymmetric ? 0.02 : 0.03,
                .asymmetric = asymmetric});
}

// Turned about the camera's axis, radians.
RenderedBoard CirclesSeenFrom(const Board& board, double tilt, double turn, int seed,
                              RenderSettings settings = {}) {
  std::mt19937_64 random(seed);
  const Eigen::Isometry3d pose =
      Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitZ()) * RandomPose(board, 0.45, tilt, random);
  return RenderedBoard(board, Intrinsics(260, 220, 270, -0.2), pose, settings, random);
}

struct MiddleErrors {
  size_t circles = 0;
  double rms = 0;    // per axis, pixels
  double worst = 0;  // pixels
  double chi2 = 0;   // per degree of freedom
};

MiddleErrors MiddleErrorsIn(const RenderedBoard& rendered, const Board& board) {
  MiddleErrors errors;
  for (const DetectedTag& mark : DetectCircles(board, rendered.image())) {
    const double error = (mark.corners[0] - rendered.Corner(mark.tag, 0)).norm();
    errors.rms += error * error / 2;
    errors.chi2 += error * error / (2 * mark.sigma * mark.sigma);
    errors.worst = std::max(errors.worst, error);
    ++errors.circles;
  }
  errors.rms = std::sqrt(errors.rms / static_cast<double>(errors.circles));
  errors.chi2 /= static_cast<double>(errors.circles);
  return errors;
}

TEST(Circles, AreGoodToHundredthsOfAPixelFromAllSides) {
  for (const double blur : {0.4, 1.0}) {
    for (int seed = 1; seed <= 2; ++seed) {
      const Board board = Circles(4, 11, true);
      const MiddleErrors errors =
          MiddleErrorsIn(CirclesSeenFrom(board, 0.7, 2.1 * seed, seed, {.blur = blur}), board);
      SCOPED_TRACE(testing::Message() << "blur " << blur << " seed " << seed);
      EXPECT_EQ(errors.circles, 44u);
      EXPECT_LT(errors.rms, 0.03);
      EXPECT_LT(errors.worst, 0.1);
      EXPECT_LT(errors.chi2, 2.5);
      EXPECT_GT(errors.chi2, 0.2);
    }
  }
}

// Those look the same turned by half: the first circle is the one nearer to the top left.
TEST(Circles, OfASymmetricBoardAreAsGoodWithTheFirstOneNearerToTheTopLeft) {
  for (int seed = 1; seed <= 2; ++seed) {
    const Board board = Circles(7, 5, false);
    const double turn = 0.8 * seed - 1.2;
    const MiddleErrors errors = MiddleErrorsIn(CirclesSeenFrom(board, 0.6, turn, seed), board);
    EXPECT_EQ(errors.circles, 35u) << seed;
    EXPECT_LT(errors.worst, 0.1) << seed;
  }
}

TEST(Circles, OfABoardThatIsNotSeenWholeAreNotMadeUp) {
  const Board board = Circles(4, 11, true);
  const RenderedBoard rendered = CirclesSeenFrom(board, 0.4, 0.5, 2);
  cv::Mat image = rendered.image().clone();
  EXPECT_EQ(DetectCircles(board, image).size(), 44u);
  const Eigen::Vector2d at = rendered.Corner(17, 0);
  image(cv::Rect(static_cast<int>(at.x()) - 8, static_cast<int>(at.y()) - 8, 16, 16)) =
      image.at<uint8_t>(static_cast<int>(at.y()) - 9, static_cast<int>(at.x()) - 9);
  EXPECT_TRUE(DetectCircles(board, image).empty());
}

}  // namespace
}  // namespace silhouette
