// SPDX-License-Identifier: Apache-2.0
// Tables 1 and 2 of the paper, on the example of its Figures 3 and 4.
#include <gtest/gtest.h>

#include <stdexcept>
#include <string>
#include <vector>

#include "server/collision/collision_images.h"
#include "server/collision/obstacle_image.h"
#include "tests/random.h"

namespace silhouette {
namespace {

// Rows of an image, one letter per pixel, top to bottom.
using Rows = std::vector<std::string>;

// B: background, F: foreground, R: robot, O: obstacle, U: unknown, E: error.
const Rows kScene = {"BBBBBBFF", "BBBBBFFF", "BBBFFFFB", "BBFFFBBB",
                     "BFBFBBFF", "FFFBBBFF", "FFFBBBBB", "FFFBBBBB"};
const Rows kRobot = {"BBBBBBBB", "BBBBBBBB", "BBBRRRRB", "BBRRRBBB",
                     "BRRRBBBB", "RRRBBBBB", "RRRBBBBB", "RRRBBBBB"};
const Rows kObstacle = {"BBBBBBOO", "BBBBBOOO", "BBBUUUUB", "BBUUUBBB",
                        "BUEUBBOO", "UUUBBBOO", "UUUBBBBB", "UUUBBBBB"};
const Rows kTestRobot = {"BBBBBBBB", "BBBBBBBB", "BBBBBBBB", "BBRRRBBB",
                         "BRRRRRBB", "RRRBBRRB", "RRRBBBBB", "RRRBBBBB"};
const Rows kIntersection = {"BBBBBBBB", "BBBBBBBB", "BBBBBBBB", "BBUUUBBB",
                            "BUEUBBBB", "UUUBBBOB", "UUUBBBBB", "UUUBBBBB"};

// The pixels that have this letter.
Mask PixelsOf(const Rows& rows, char letter) {
  const MaskSize size{static_cast<int>(rows[0].size()), static_cast<int>(rows.size())};
  return Mask::FromPredicate(size, [&](int x, int y) { return rows[y][x] == letter; });
}

template <typename Image>
Rows RowsOf(const Image& image) {
  Rows rows;
  for (int y = 0; y < image.size().height; ++y) {
    rows.emplace_back();
    for (int x = 0; x < image.size().width; ++x) {
      const bool obstacle = image.obstacle().at(x, y);
      const bool unknown = image.unknown().at(x, y);
      const bool error = image.error().at(x, y);
      EXPECT_LE(obstacle + unknown + error, 1) << "the planes overlap at " << x << ", " << y;
      rows.back() += obstacle ? 'O' : unknown ? 'U' : error ? 'E' : 'B';
    }
  }
  return rows;
}

ObstacleImage PaperObstacleImage() {
  return ObstacleImage::FromScene(PixelsOf(kScene, 'F'), PixelsOf(kRobot, 'R'));
}

// One pixel of scene and robot, as Table 1 pairs them.
std::string Table1(bool foreground, bool robot) {
  const auto pixel = [](bool set) {
    return Mask::FromPredicate({1, 1}, [=](int, int) { return set; });
  };
  return RowsOf(ObstacleImage::FromScene(pixel(foreground), pixel(robot)))[0];
}

TEST(Table1, BackgroundWithoutRobotIsBackground) { EXPECT_EQ(Table1(false, false), "B"); }
TEST(Table1, BackgroundWhereTheRobotShouldBeIsError) { EXPECT_EQ(Table1(false, true), "E"); }
TEST(Table1, ForegroundWithoutRobotIsObstacle) { EXPECT_EQ(Table1(true, false), "O"); }
TEST(Table1, ForegroundOnTheRobotIsUnknown) { EXPECT_EQ(Table1(true, true), "U"); }

TEST(Table1, GivesThePaperFigure3RowByRow) {
  const Rows rows = RowsOf(PaperObstacleImage());
  ASSERT_EQ(rows.size(), kObstacle.size());
  for (size_t i = 0; i < rows.size(); ++i) EXPECT_EQ(rows[i], kObstacle[i]) << "row " << i + 1;
}

TEST(Table1, BackgroundIsWhatNoOtherPlaneHolds) {
  EXPECT_EQ(PaperObstacleImage().Background(), PixelsOf(kObstacle, 'B'));
}

TEST(Table2, GivesThePaperFigure4RowByRow) {
  const Rows rows = RowsOf(IntersectionImage(PaperObstacleImage(), PixelsOf(kTestRobot, 'R')));
  ASSERT_EQ(rows.size(), kIntersection.size());
  for (size_t i = 0; i < rows.size(); ++i) EXPECT_EQ(rows[i], kIntersection[i]) << "row " << i + 1;
}

TEST(UncalibratedCollisionImages, KeepObstaclesAndTakeUnknownAndErrorForBackground) {
  const IntersectionImage image(PaperObstacleImage(), PixelsOf(kTestRobot, 'R'));
  const CollisionImages collision_images =
      UncalibratedCollisionImages({image, std::nullopt, image});
  ASSERT_EQ(collision_images.size(), 3u);
  EXPECT_EQ(collision_images[0], PixelsOf(kIntersection, 'O'));
  EXPECT_EQ(collision_images[1], std::nullopt);
  EXPECT_EQ(collision_images[2], PixelsOf(kIntersection, 'O'));
}

TEST(ObstacleImage, BetweenGridPointsObstacleOnlyWhereNoCornerShowsTheRobotErrorOnlyWhereAllDo) {
  const Rows scene = {"FFFBBB"};
  const Rows anywhere = {"BRRBRR"};
  const Rows certain = {"BBRBBR"};
  const ObstacleImage image = ObstacleImage::FromScene(
      PixelsOf(scene, 'F'), PixelsOf(anywhere, 'R'), PixelsOf(certain, 'R'));
  EXPECT_EQ(RowsOf(image)[0], "OUUBBE");
}

TEST(ObstacleImage, CornersWhoseIntersectionExceedsTheirUnionAreRefused) {
  const Mask all = PixelsOf({"RR"}, 'R');
  EXPECT_THROW(ObstacleImage::FromScene(all, PixelsOf({"RB"}, 'R'), all), std::invalid_argument);
}

TEST(ObstacleImage, FromAReadyObstacleMaskTheRobotStaysUnknownAndThereAreNoErrors) {
  const Rows obstacles = {"FFBB"};
  const Rows robot = {"BRRB"};
  EXPECT_EQ(RowsOf(ObstacleImage::FromObstacles(PixelsOf(obstacles, 'F'), PixelsOf(robot, 'R')))[0],
            "OOUB");
}

TEST(ObstacleImage, SizesThatDifferAreRefused) {
  EXPECT_THROW(ObstacleImage::FromScene(Mask({2, 2}), Mask({2, 3})), std::invalid_argument);
  EXPECT_THROW(ObstacleImage::FromObstacles(Mask({2, 2}), Mask({4, 1})), std::invalid_argument);
}

TEST(ObstacleImage, IgnoredPixelsAreUnknownAndNothingElse) {
  const Mask scene = PixelsOf({"BFBF"}, 'F');
  const Mask robot = PixelsOf({"BBRR"}, 'R');
  const ObstacleImage image = ObstacleImage::FromScene(scene, robot);
  ASSERT_EQ(RowsOf(image)[0], "BOEU");
  EXPECT_EQ(RowsOf(image.Ignoring(PixelsOf({"XXXX"}, 'X')))[0], "UUUU");
  EXPECT_EQ(RowsOf(image.Ignoring(PixelsOf({"-X--"}, 'X')))[0], "BUEU");
  EXPECT_EQ(RowsOf(image.Ignoring(PixelsOf({"----"}, 'X')))[0], "BOEU");
}

// The robot R at the left; o: foreground with weak evidence, F: with strong evidence.
Rows WithoutWeakRim(const Rows& rows) {
  const Mask robot = PixelsOf(rows, 'R');
  const Mask strong = PixelsOf(rows, 'F') | robot;
  const ObstacleImage image = ObstacleImage::FromScene(strong | PixelsOf(rows, 'o'), robot);
  return RowsOf(image.WithoutWeakRim(strong, robot));
}

TEST(WeakRim, LoneFaintComponentsThatTouchTheRobotAreUnknown) {
  EXPECT_EQ(WithoutWeakRim({"RBBB", "RoBB", "RBBB", "RoBB", "RoBB", "RoBB", "BBBB"}),
            (Rows{"UBBB", "UUBB", "UBBB", "UUBB", "UUBB", "UUBB", "BBBB"}));
  EXPECT_EQ(WithoutWeakRim({"RBB", "BoB"}), (Rows{"UBB", "BUB"})) << "at a corner";
}

TEST(WeakRim, WhatIsPlainFartherAwayOrJoinsSuchStaysAnObstacle) {
  EXPECT_EQ(WithoutWeakRim({"RFB"}), (Rows{"UOB"})) << "plain";
  EXPECT_EQ(WithoutWeakRim({"RoB", "RoB", "RFB"}), (Rows{"UOB", "UOB", "UOB"})) << "joins plain";
  EXPECT_EQ(WithoutWeakRim({"RooB"}), (Rows{"UOOB"})) << "reaches farther";
  EXPECT_EQ(WithoutWeakRim({"RoBB", "RBoB"}), (Rows{"UOBB", "UBOB"})) << "joins by a corner";
  EXPECT_EQ(WithoutWeakRim({"RBoB"}), (Rows{"UBOB"})) << "touches nothing";
  EXPECT_EQ(WithoutWeakRim({"RoB", "RoB", "RoB", "RoB"}), (Rows{"UOB", "UOB", "UOB", "UOB"}))
      << "a hand";
}

TEST(WeakRim, NothingBecomesBackgroundAndNoPlainObstacleIsLost) {
  Random random;
  const auto some = [&](MaskSize size, int of_ten) {
    return Mask::FromPredicate(size,
                               [&](int, int) { return static_cast<int>(random() % 10) < of_ten; });
  };
  for (int i = 0; i < 300; ++i) {
    const MaskSize size{1 + static_cast<int>(random() % 80), 1 + static_cast<int>(random() % 9)};
    const Mask scene = some(size, 1 + i % 5);
    const Mask robot = some(size, 2);
    const Mask strong = some(size, 1);
    const ObstacleImage image = ObstacleImage::FromScene(scene, robot);
    const ObstacleImage result = image.WithoutWeakRim(strong, robot);
    EXPECT_EQ(result.Background(), image.Background());
    EXPECT_EQ(result.error(), image.error());
    EXPECT_EQ(result.obstacle() | result.unknown(), image.obstacle() | image.unknown());
    EXPECT_TRUE(((image.obstacle() & strong) - result.obstacle()).Empty());
    EXPECT_TRUE((image.obstacle() - Grown(robot, 1) - result.obstacle()).Empty());
    // What stays is whole components: none of it touches what became unknown.
    const Mask gone = image.obstacle() - result.obstacle();
    EXPECT_TRUE((Grown(gone, 1) & result.obstacle()).Empty());
  }
}

TEST(ObstacleImage, MarginGrowsObstaclesOverEverythingAndTheRestOverBackground) {
  const auto with_margin = [](const std::string& pixels) {
    const Rows rows = {pixels};
    const Mask obstacle = PixelsOf(rows, 'O'), unknown = PixelsOf(rows, 'U');
    const ObstacleImage image =
        ObstacleImage::FromScene(obstacle | unknown, unknown | PixelsOf(rows, 'E'));
    EXPECT_EQ(RowsOf(image)[0], pixels);
    EXPECT_EQ(RowsOf(image.WithMargin(0))[0], pixels);
    return RowsOf(image.WithMargin(1))[0];
  };
  EXPECT_EQ(with_margin("BBOBBB"), "BOOOBB");
  EXPECT_EQ(with_margin("UOEEBB"), "OOOEEB");
  EXPECT_EQ(with_margin("BBUBBB"), "BUUUBB");
  EXPECT_EQ(with_margin("BBEUBB"), "BEEUUB");
  EXPECT_EQ(with_margin("EEBUUU"), "EEUUUU");
  EXPECT_THROW(PaperObstacleImage().WithMargin(-1), std::invalid_argument);
}

}  // namespace
}  // namespace silhouette
