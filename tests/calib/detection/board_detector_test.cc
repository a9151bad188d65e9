// SPDX-License-Identifier: Apache-2.0
// The corners of chessboards and ChArUco boards against where they really are, in
// rendered images.
#include "calib/detection/board_detector.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/aruco.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <set>
#include <stdexcept>

#include "calib/boards/tag_family.h"
#include "calib/detection/image_tags.h"
#include "tests/calib/detection/corner_errors.h"
#include "tests/calib/detection/rendered_board.h"
#include "tests/random.h"

namespace silhouette {
namespace {

constexpr double kBoardFocal = 300;  // of images of 320 x 240 pixels

Board Chessboard(int columns, int rows) {
  return Board({.name = "hand",
                .kind = BoardKind::kChessboard,
                .rows = rows,
                .columns = columns,
                .square = 0.03});
}

Board Charuco(int columns, int rows, bool legacy = false) {
  return Board({.name = "plate",
                .kind = BoardKind::kCharuco,
                .dictionary = "DICT_4X4_50",
                .rows = rows,
                .columns = columns,
                .tag_size = 0.03,
                .square = 0.04,
                .legacy = legacy});
}

Board AprilGrid() {
  return Board({.name = "grid",
                .family = kKalibrFamily,
                .rows = 2,
                .columns = 3,
                .tag_size = 0.085,
                .gap = 0.0255,
                .from_bottom = true});
}

// A GridBoard of OpenCV.
Board ArucoGrid() {
  return Board({.name = "markers",
                .family = "DICT_5X5_100",
                .rows = 3,
                .columns = 4,
                .tag_size = 0.06,
                .gap = 0.015,
                .first_id = 20});
}

struct Sight {
  double distance = 0.4;
  double tilt = 0.5;                                // at most, radians
  double turn = 0;                                  // about the camera's axis, radians
  Eigen::Vector2d aside = Eigen::Vector2d::Zero();  // metres
  RenderSettings settings = {};
};

RenderedBoard Seen(const Board& board, const Sight& sight, int seed) {
  std::mt19937_64 random(seed);
  const Eigen::Isometry3d pose = Eigen::Translation3d(sight.aside.x(), sight.aside.y(), 0) *
                                 Eigen::AngleAxisd(sight.turn, Eigen::Vector3d::UnitZ()) *
                                 RandomPose(board, sight.distance, sight.tilt, random);
  return RenderedBoard(board, Intrinsics(320, 240, kBoardFocal, -0.2), pose, sight.settings,
                       random);
}

CornerErrors ErrorsIn(const RenderedBoard& rendered, const Board& board,
                      const std::optional<CameraModel>& lens = std::nullopt) {
  return ErrorsIn(rendered.image(), rendered, board, lens);
}

TEST(BoardDetector, CornersOfEachKindAreGoodToHundredthsOfAPixelAtASessionsAngles) {
  for (const Board& board : {Chessboard(8, 5), Charuco(6, 5)}) {
    SCOPED_TRACE(board.family());
    const CornerErrors errors = ErrorsIn(Seen(board, {}, 1), board);
    EXPECT_EQ(errors.corners, static_cast<size_t>(board.tags() * board.corners_per_mark()));
    EXPECT_LT(errors.rms, 0.06);
    EXPECT_LT(errors.worst, 0.25);
    EXPECT_GT(errors.chi2, 0.2);
    EXPECT_LT(errors.chi2, 2);
  }
}

TEST(BoardDetector, CornersOfArucoMarkersAreGoodToHundredthsOfAPixelFromAllSides) {
  const Board board = ArucoGrid();
  for (int seed = 1; seed <= SampleCount(6); ++seed) {
    const CornerErrors errors =
        ErrorsIn(Seen(board, {.distance = 0.55, .tilt = 0.7, .turn = seed * 1.1}, seed), board);
    EXPECT_GE(errors.corners, 40u) << seed;
    EXPECT_LT(errors.rms, 0.06) << seed;
    EXPECT_LT(errors.worst, 0.25) << seed;
    EXPECT_LT(errors.chi2, 2.5) << seed;
  }
}

// OpenCV overlooks some.
TEST(BoardDetector, EveryArucoMarkerOfABoardThatIsSeenWholeIsFound) {
  const Board board({.name = "markers",
                     .family = "DICT_5X5_100",
                     .rows = 5,
                     .columns = 7,
                     .tag_size = 0.04,
                     .gap = 0.01});
  for (int seed = 1; seed <= SampleCount(3); ++seed) {
    std::mt19937_64 random(seed);
    const RenderedBoard rendered(board, Intrinsics(480, 480, 700, -0.15),
                                 Eigen::AngleAxisd(seed * 0.8, Eigen::Vector3d::UnitZ()) *
                                     RandomPose(board, 0.7, 0.6, random),
                                 {.blur = 0.8}, random);
    const CornerErrors errors = ErrorsIn(rendered, board);
    EXPECT_EQ(errors.corners, static_cast<size_t>(4 * board.tags())) << seed;
    EXPECT_LT(errors.worst, 0.4) << seed;
  }
}

// Its edges bend as no parabola does, and where the image cuts a square a corner has only one.
TEST(BoardDetector, CornersOfLargeSquaresInTheImagesCornerAreAsExactAsStated) {
  const Board board = Charuco(5, 4);
  for (int seed = 1; seed <= SampleCount(3); ++seed) {
    std::mt19937_64 random(seed);
    const Eigen::Isometry3d pose = Eigen::Translation3d(-0.06, -0.045, 0) *
                                   Eigen::AngleAxisd(0.15 * seed, Eigen::Vector3d::UnitZ()) *
                                   RandomPose(board, 0.2, 0.5, random);
    const RenderedBoard rendered(board, Intrinsics(800, 600, 750, -0.2), pose, {.blur = 0.4},
                                 random);
    const CornerErrors errors = ErrorsIn(rendered, board);
    EXPECT_GE(errors.corners, 6u) << seed;
    EXPECT_LT(errors.chi2, 4) << seed;
    EXPECT_LT(errors.worst, 0.06) << seed;
  }
}

// The markers as OpenCV draws and numbers them.
TEST(BoardDetector, AGridBoardThatOpenCvDrewHasItsIdsAndCornersWhereTheBoardHasThem) {
  const Board board = ArucoGrid();
  const auto drawn = cv::aruco::GridBoard::create(
      4, 3, 0.06f, 0.015f, cv::aruco::getPredefinedDictionary(cv::aruco::DICT_5X5_100), 20);
  cv::Mat image;
  drawn->draw({640, 480}, image, 40, 1);
  BoardDetector detector({board});
  const std::vector<DetectedTag> tags = detector.Detect(image);
  ASSERT_EQ(tags.size(), 12u);
  std::vector<cv::Point2d> on_board;
  std::vector<cv::Point2d> seen;
  for (const DetectedTag& tag : tags) {
    for (size_t i = 0; i < 4; ++i) {
      const Eigen::Vector3d corner = board.CornersOf(tag.tag)[i];
      on_board.emplace_back(corner.x(), corner.y());
      seen.emplace_back(tag.corners[i].x(), tag.corners[i].y());
    }
  }
  const cv::Mat affine = cv::estimateAffinePartial2D(on_board, seen);
  EXPECT_NEAR(affine.at<double>(0, 1), 0, 5) << "not turned: x is to the right, pixels a metre";
  EXPECT_GT(affine.at<double>(0, 0), 0);
  for (size_t i = 0; i < seen.size(); ++i) {
    const cv::Mat at = affine * cv::Mat(cv::Vec3d(on_board[i].x, on_board[i].y, 1));
    EXPECT_NEAR(at.at<double>(0), seen[i].x, 1) << i;
    EXPECT_NEAR(at.at<double>(1), seen[i].y, 1) << i;
  }
}

// Kalibr's own board, 6 x 6 tags of 33 pixels.
RenderedBoard AprilGridSeen(const Board& board, int seed) {
  std::mt19937_64 random(seed);
  return RenderedBoard(board, Intrinsics(480, 420, 390, -0.15), RandomPose(board, 0.9, 0.3, random),
                       {}, random);
}

Board WholeAprilGrid() {
  BoardDescription whole = AprilGrid().description();
  whole.rows = whole.columns = 6;
  return Board(whole);
}

TEST(BoardDetector, AllTagsOfAnAprilGridAreFoundThoughSquaresTouchThem) {
  const Board board = WholeAprilGrid();
  const RenderedBoard rendered = AprilGridSeen(board, 3);
  const CameraModel lens(rendered.intrinsics());
  for (const auto& known : {std::optional<CameraModel>(), std::optional(lens)}) {
    const CornerErrors errors = ErrorsIn(rendered, board, known);
    EXPECT_GE(errors.corners, size_t{4 * 35});
    EXPECT_LT(errors.rms, 0.08);
    EXPECT_LT(errors.worst, 0.5);
  }
}

TEST(BoardDetector, BlurThatJoinsTheTagsOfAnAprilGridWithItsSquaresCostsFew) {
  const Board board = WholeAprilGrid();
  for (const double blur : {0.8, 1.2}) {
    for (int seed = 3; seed < 3 + SampleCount(2); ++seed) {
      SCOPED_TRACE(testing::Message() << "blur " << blur << " seed " << seed);
      std::mt19937_64 random(seed);
      const RenderedBoard rendered(board, Intrinsics(960, 840, 900, -0.1),
                                   RandomPose(board, 0.9, 0.4, random), {.blur = blur}, random);
      const CornerErrors errors = ErrorsIn(rendered, board);
      EXPECT_GE(errors.corners, size_t{4 * 33});
      EXPECT_LT(errors.rms, 0.06);
      EXPECT_LT(errors.worst, 0.3);
    }
  }
}

// OpenCV sees these squares as quadrilaterals, the AprilTag library does not.
TEST(BoardDetector, SmallBlurredTagsOfAnAprilGridAreFoundAtEveryAngle) {
  const Board board = WholeAprilGrid();
  for (int seed = 1; seed <= SampleCount(3); ++seed) {
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    std::mt19937_64 random(seed);
    const Eigen::Isometry3d pose = Eigen::AngleAxisd(0.7 * seed, Eigen::Vector3d::UnitZ()) *
                                   RandomPose(board, 1.05, 0.5, random);
    const RenderedBoard rendered(board, Intrinsics(400, 400, 390, -0.15), pose,
                                 {.blur = 0.9, .black = 5, .white = 50}, random);
    const CornerErrors errors = ErrorsIn(rendered, board);
    EXPECT_GE(errors.corners, size_t{4 * 33});
    EXPECT_LT(errors.rms, 0.15);
    EXPECT_LT(errors.worst, 0.8);
  }
}

TEST(BoardDetector, TagOfAnAprilGridThatIsCoveredIsNotMadeUp) {
  const Board board = WholeAprilGrid();
  const RenderedBoard rendered = AprilGridSeen(board, 1);
  cv::Mat image = rendered.image().clone();
  const auto point = [&](int corner) {
    const Eigen::Vector2d at = rendered.Corner(14, corner);
    return cv::Point(static_cast<int>(at.x()), static_cast<int>(at.y()));
  };
  const std::vector<cv::Point> tag = {point(0), point(1), point(2), point(3)};
  BoardDetector detector({board});
  const auto seen = [&] {
    const std::vector<DetectedTag> tags = detector.Detect(image);
    return std::ranges::count_if(tags, [](const DetectedTag& t) { return t.tag == 14; });
  };
  EXPECT_EQ(seen(), 1);
  cv::fillConvexPoly(image, tag, cv::Scalar(40));
  EXPECT_EQ(seen(), 0) << "all black";
}

TEST(BoardDetector, CornersOfChessboardsAreAsGoodWithoutAKnownLens) {
  const Board board = Chessboard(8, 5);
  for (int seed = 4; seed < 4 + SampleCount(3); ++seed) {
    const RenderedBoard rendered = Seen(board, {}, seed);
    const CameraModel lens(rendered.intrinsics());
    EXPECT_LT(ErrorsIn(rendered, board).rms, 1.1 * ErrorsIn(rendered, board, lens).rms);
  }
}

// Bright areas then grow into dark ones.
TEST(BoardDetector, OverexposureMovesCornersOfAChessboardByLessThanATenthOfAPixel) {
  const Board board = Chessboard(8, 5);
  const RenderedBoard rendered = Seen(board, {}, 4);
  const cv::Mat bright = rendered.image() * 1.8;
  const CornerErrors errors = ErrorsIn(bright, rendered, board);
  EXPECT_EQ(errors.corners, static_cast<size_t>(board.tags() * board.corners_per_mark()));
  EXPECT_LT(errors.rms, 0.1);
}

// Tape over the squares beyond the first row: its edges lie beside theirs.
TEST(BoardDetector, WhatCoversTheRimOfAChessboardMovesNoCornerFar) {
  const Board board = Chessboard(5, 4);
  const RenderedBoard rendered = Seen(board, {.distance = 0.25, .tilt = 0.2}, 4);
  const auto corner = [&](int number) { return rendered.Corner(number, 0); };
  for (const double beside : {-0.09, -0.06, 0.06, 0.09}) {  // sides of a square, of 33 pixels
    cv::Mat covered = rendered.image().clone();
    for (int number = 0; number < 5; ++number) {
      const Eigen::Vector2d out = corner(number) - corner(number + 5);
      const Eigen::Vector2d aside(-out.y(), out.x());
      const auto fill = [&](double from, double to, double grey) {
        std::vector<cv::Point> part;
        for (const auto& [away, side] : {std::pair{0.2, from}, {1.2, from}, {1.2, to}, {0.2, to}}) {
          const Eigen::Vector2d at = corner(number) + away * out + side * aside;
          part.emplace_back(cvRound(16 * at.x()), cvRound(16 * at.y()));
        }
        cv::fillConvexPoly(covered, part, cv::Scalar(grey), cv::LINE_AA, 4);
      };
      fill(-0.3, beside, number % 2 == 0 ? 40 : 210);
      fill(beside, 0.3, number % 2 == 0 ? 210 : 40);
    }
    const CornerErrors errors = ErrorsIn(covered, rendered, board);
    EXPECT_EQ(errors.corners, 20u);
    EXPECT_LT(errors.worst, 0.4) << beside;
  }
}

TEST(BoardDetector, BoardsAreFoundInTheirFrameHoweverTheyAreTurned) {
  for (const Board& board : {Chessboard(4, 7), Charuco(5, 4)}) {
    const RenderedBoard rendered = Seen(board, {.tilt = 0.2}, 5);
    cv::Mat image = rendered.image();
    BoardDetector detector({board});
    for (int quarter = 0; quarter < 4; ++quarter) {
      SCOPED_TRACE(testing::Message() << board.family() << ", turned by " << 90 * quarter);
      const std::vector<DetectedTag> marks = detector.Detect(image);
      EXPECT_EQ(marks.size(), static_cast<size_t>(board.tags()));
      for (const DetectedTag& mark : marks) {
        Eigen::Vector2d at = rendered.Corner(mark.tag, 0);
        int height = rendered.image().rows;
        for (int turn = 0; turn < quarter; ++turn) {
          at = Eigen::Vector2d(height - 1 - at.y(), at.x());
          height = turn % 2 == 0 ? rendered.image().cols : rendered.image().rows;
        }
        EXPECT_LT((mark.corners.front() - at).norm(), 0.5) << mark.tag;
      }
      cv::rotate(image.clone(), image, cv::ROTATE_90_CLOCKWISE);
    }
  }
}

TEST(BoardDetector, OfAPartOfACharucoBoardTheCornersInTheImageAreFound) {
  const Board board = Charuco(6, 5);
  const RenderedBoard rendered = Seen(board, {.distance = 0.3, .aside = {0.1, 0.05}}, 2);
  const CornerErrors errors = ErrorsIn(rendered, board);
  EXPECT_GE(errors.corners, 6u);
  EXPECT_LT(errors.corners, static_cast<size_t>(board.tags()));
  EXPECT_LT(errors.worst, 0.3);
}

TEST(BoardDetector, ACharucoBoardOfTheOtherLayoutIsFoundAsItIs) {
  const Board printed = Charuco(5, 4, true);
  EXPECT_LT(ErrorsIn(Seen(printed, {}, 1), Charuco(5, 4, false)).worst, 0.3);
}

TEST(BoardDetector, ACharucoBoardWithRowsAndColumnsExchangedIsNotTakenForTheDescribedOne) {
  const Board described = Charuco(5, 6);
  BoardDetector detector({described});
  const ImageTags found = FindTags(detector, Seen(Charuco(6, 5), {}, 1).image(), std::nullopt);
  EXPECT_TRUE(found.tags.empty());
  ASSERT_FALSE(found.foreign.empty());
  EXPECT_EQ(found.foreign.front().family, Charuco(6, 5).family());
}

TEST(BoardDetector, UnevenLightAndJpegLeaveCornersWithinTenthsOfAPixel) {
  for (const Board& board : {Chessboard(8, 5), Charuco(6, 5)}) {
    SCOPED_TRACE(board.family());
    const RenderedBoard rendered = Seen(board, {}, 6);
    cv::Mat_<uint8_t> image = rendered.image().clone();
    for (int y = 0; y < image.rows; ++y) {
      for (int x = 0; x < image.cols; ++x) {
        image(y, x) = cv::saturate_cast<uint8_t>(image(y, x) * (0.4 + 0.7 * x / image.cols));
      }
    }
    std::vector<uint8_t> jpeg;
    cv::imencode(".jpg", image, jpeg, {cv::IMWRITE_JPEG_QUALITY, 85});
    const CornerErrors errors = ErrorsIn(cv::imdecode(jpeg, cv::IMREAD_GRAYSCALE), rendered, board);
    EXPECT_EQ(errors.corners, static_cast<size_t>(board.tags() * board.corners_per_mark()));
    EXPECT_LT(errors.worst, 0.4);
  }
}

TEST(BoardDetector, WithoutABoardNothingIsFound) {
  BoardDetector detector({Chessboard(8, 5), Charuco(6, 5), AprilGrid()});
  cv::Mat noise(180, 240, CV_8UC1);
  cv::theRNG().state = 1;
  cv::randu(noise, 0, 255);
  EXPECT_TRUE(detector.Detect(noise).empty());
  EXPECT_TRUE(detector.Detect(cv::Mat(2, 2, CV_8UC1, cv::Scalar(128))).empty());
  EXPECT_THROW(detector.Detect(cv::Mat(20, 20, CV_8UC3)), std::invalid_argument);
  EXPECT_THROW(BoardDetector({}), std::invalid_argument);
}

TEST(BoardDetector, AChessboardOfAnotherSizeIsNotFound) {
  const cv::Mat image = Seen(Chessboard(5, 8), {}, 1).image();
  BoardDetector detector({Chessboard(9, 6)});
  EXPECT_TRUE(detector.Detect(image).empty());
  EXPECT_EQ(DictionaryIn(Seen(Charuco(6, 5), {}, 1).image()), "DICT_4X4_50");
}

}  // namespace
}  // namespace silhouette
