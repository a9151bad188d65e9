// SPDX-License-Identifier: Apache-2.0
// The middles of circles against where they really are, in rendered images.
#include "calib/detection/circle_grid.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "tests/calib/detection/corner_errors.h"
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

TEST(Circles, AreGoodToHundredthsOfAPixelFromAllSides) {
  for (const double blur : {0.4, 1.0}) {
    for (int seed = 1; seed <= 2; ++seed) {
      const Board board = Circles(4, 11, true);
      const CornerErrors errors =
          ErrorsIn(CirclesSeenFrom(board, 0.7, 2.1 * seed, seed, {.blur = blur}), board);
      SCOPED_TRACE(testing::Message() << "blur " << blur << " seed " << seed);
      EXPECT_EQ(errors.corners, 44u);
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
    const CornerErrors errors = ErrorsIn(CirclesSeenFrom(board, 0.6, turn, seed), board);
    EXPECT_EQ(errors.corners, 35u) << seed;
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

// OpenCV overlooks a circle that is cut in two, and makes one up from the others.
TEST(Circles, ThatAScratchCutsAreFoundWhereTheyAre) {
  const Board board = Circles(3, 5, true);
  for (const auto& [circle, slope] : {std::pair{14, 0}, {2, 7}, {11, 9}}) {
    std::mt19937_64 random(3);
    const Eigen::Isometry3d pose = RandomPose(board, 0.45, 0.6, random);
    const RenderedBoard rendered(board, Intrinsics(160, 140, 300, -0.2), pose, {}, random);
    cv::Mat image = rendered.image().clone();
    const Eigen::Vector2i at = rendered.Corner(circle, 0).cast<int>();
    cv::line(image, {at.x() - 9, at.y() - slope}, {at.x() + 9, at.y() + slope}, 210, 1,
             cv::LINE_AA);
    const CornerErrors errors = ErrorsIn(image, rendered, board);
    EXPECT_EQ(errors.corners, 15u) << circle;
    EXPECT_LT(errors.worst, 0.25) << circle;
  }
}

}  // namespace
}  // namespace silhouette
