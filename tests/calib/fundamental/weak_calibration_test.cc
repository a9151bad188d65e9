// SPDX-License-Identifier: Apache-2.0
#include "calib/fundamental/weak_calibration.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <regex>

#include "calib/fundamental/epipolar_geometry.h"
#include "tests/calib/fundamental/seen_cell.h"

namespace silhouette {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::Optional;

constexpr double kServersMargin = 0.25;

struct Cell {
  std::vector<NamedCamera> cameras = CellCameras();
  BoardFrames board;

  ViewPair Pair(size_t a = 0, size_t b = 1) const {
    return CornersOfPair(board.sightings, cameras[a].view, cameras[b].view);
  }
  WeakCalibration Calibrate(const ViewPair& pair, double most_margin = kServersMargin) const {
    return CalibrateWeakly(pair, SizesOf(cameras[0].model), SizesOf(cameras[1].model), most_margin,
                           1);
  }
};

// Most frames show the board to neighbouring cameras.
Cell SeenCell(size_t frames, uint64_t seed, double k1 = 0) {
  Cell cell{.cameras = CellCameras(k1), .board = {}};
  cell.board = CarriedBoard(cell.cameras, frames, seed);
  return cell;
}

TEST(WeakCalibration, HeldOutCornersLieOnTheLinesToWithinTheirNoise) {
  for (const uint64_t seed : {1, 2, 3}) {
    const Cell cell = SeenCell(60, seed);
    const WeakCalibration found = cell.Calibrate(cell.Pair());
    ASSERT_FALSE(found.refusal) << *found.refusal;
    EXPECT_LE(found.held_out.rms, 0.05) << "seed " << seed;
    EXPECT_TRUE(found.frames_held_out);
    // Nearly all of it is the corners' own noise, in both images.
    EXPECT_NEAR(found.held_out.noise, std::sqrt(2) * 0.03, 0.005) << "seed " << seed;
    EXPECT_NEAR(found.held_out.rms / found.held_out.noise, 1, 0.1) << "seed " << seed;
    EXPECT_NEAR(found.spread, 1, 0.1);
    EXPECT_LT(found.margin, 0.1);
    EXPECT_NEAR(found.f.determinant(), 0, 1e-15);
    // Points without noise are closer still.
    const Eigen::Vector3d point(0.3, -0.2, 1.1);
    const EpipolarDistance distance = DistanceBetween(
        found.f, *cell.cameras[0].model.Project(point), *cell.cameras[1].model.Project(point));
    EXPECT_LT(distance.in_b, 0.03) << "seed " << seed;
  }
}

TEST(WeakCalibration, WrongTagsAreLeftOut) {
  const Cell cell = SeenCell(40, 5);
  ViewPair pair = cell.Pair();
  std::mt19937 random(7);
  int wrong = 0;
  for (size_t i = 0; i + 4 <= pair.corners.size(); i += 4) {
    if (random() % 6 != 0) continue;
    const Eigen::Vector2d off(20 + static_cast<double>(random() % 60), -35);
    for (size_t k = i; k < i + 4; ++k) pair.corners[k].b += off;
    wrong += 4;
  }
  const WeakCalibration found = cell.Calibrate(pair);
  ASSERT_FALSE(found.refusal) << *found.refusal;
  EXPECT_GE(found.outliers, wrong * 9 / 10);  // some may have moved along their lines
  EXPECT_LE(found.outliers, wrong + static_cast<int>(pair.corners.size()) / 500 + 2);
  EXPECT_LE(found.held_out.rms, 0.05);
}

TEST(WeakCalibration, ACameraThatWasPushedDuringTheSessionIsRefusedAndItsFirstFrameIsNamed) {
  const Cell cell = SeenCell(60, 5);
  ViewPair pair = cell.Pair();
  ASSERT_FALSE(cell.Calibrate(pair).refusal);
  const size_t first = pair.frames.size() * 4 / 5;
  for (Correspondence& corner : pair.corners) {
    if (corner.frame >= static_cast<int>(first)) corner.b.y() += 6;
  }
  EXPECT_THAT(cell.Calibrate(pair).refusal,
              Optional(HasSubstr("frames from '" + pair.frames[first] +
                                 "' on fit no matrix of the other frames")));
}

TEST(WeakCalibration, TheSameSeedGivesTheSameMatrix) {
  const Cell cell = SeenCell(20, 3);
  EXPECT_EQ(cell.Calibrate(cell.Pair()).f, cell.Calibrate(cell.Pair()).f);
}

TEST(WeakCalibration, OneFrameOfABoardIsRefused) {
  const Cell cell = SeenCell(1, 8);
  EXPECT_THAT(cell.Calibrate(cell.Pair()).refusal,
              Optional(HasSubstr("there is one frame, and all its tags lie on one plane")));
}

TEST(WeakCalibration, FramesInWhichNothingMovedAreOneFrame) {
  const Cell cell = SeenCell(1, 8);
  ViewPair pair = cell.Pair();
  const std::vector<Correspondence> once = pair.corners;
  for (int frame = 1; frame < 12; ++frame) {
    pair.frames.push_back("again" + std::to_string(frame));
    for (Correspondence corner : once) {
      corner.frame = frame;
      corner.tag += 100 * frame;
      corner.a.x() += 0.01 * frame;
      pair.corners.push_back(corner);
    }
  }
  EXPECT_THAT(cell.Calibrate(pair).refusal, Optional(HasSubstr("the same place in all 12 frames")));
}

TEST(WeakCalibration, RepeatedFramesAreSaid) {
  const Cell cell = SeenCell(20, 3);
  ViewPair pair = cell.Pair();
  pair.frames.push_back("again");
  const std::vector<Correspondence> once = pair.corners;
  for (Correspondence corner : once) {
    if (corner.frame != 0) continue;
    corner.frame = static_cast<int>(pair.frames.size()) - 1;
    corner.tag += 100000;
    pair.corners.push_back(corner);
  }
  const WeakCalibration found = cell.Calibrate(pair);
  EXPECT_FALSE(found.refusal);
  EXPECT_THAT(found.warnings, Contains(HasSubstr("nothing was moved since an earlier one")));
}

TEST(WeakCalibration, ABoardThatOnlySlidesInItsPlaneIsRefused) {
  Cell cell = SeenCell(1, 8);
  const Board board({.name = "floor", .rows = 3, .columns = 3, .tag_size = 0.1, .gap = 0.1});
  Chance chance(9);
  cell.board.sightings.clear();
  for (int frame = 0; frame < 12; ++frame) {
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.linear() = Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitX()).matrix();
    pose.translation() = Eigen::Vector3d(0.1 * frame - 0.6, 0.05 * frame, 0);
    for (const NamedCamera& camera : cell.cameras) {
      const auto seen =
          ProjectTags(camera, std::to_string(frame), board, pose, {.least_size = 8}, chance);
      cell.board.sightings.insert(cell.board.sightings.end(), seen.begin(), seen.end());
    }
  }
  const ViewPair pair = cell.Pair();
  ASSERT_GT(pair.corners.size(), 100u);
  EXPECT_THAT(cell.Calibrate(pair).refusal,
              Optional(HasSubstr("all tags of all frames lie on one plane")));
}

TEST(WeakCalibration, TagsInOneCornerOfTheImageAreRefused) {
  Cell cell = SeenCell(1, 8);
  cell.board = CarriedBoard(cell.cameras, 20, 6, 0.03, 0.03);
  for (TagSighting& sighting : cell.board.sightings) {
    for (Eigen::Vector2d& corner : sighting.corners) corner = 0.3 * corner;  // into the corner
  }
  EXPECT_THAT(cell.Calibrate(cell.Pair()).refusal,
              Optional(HasSubstr("all corners lie in one place of the image")));
}

TEST(WeakCalibration, TooFewCornersAreRefused) {
  const Cell cell = SeenCell(20, 4);
  ViewPair pair = cell.Pair();
  pair.corners.resize(12);
  EXPECT_THAT(cell.Calibrate(pair).refusal, Optional(HasSubstr("only 12 corners")));
}

TEST(WeakCalibration, FramesThatDoNotBelongTogetherAreRefused) {
  Cell cell = SeenCell(20, 4);
  // The second view is one frame late.
  for (TagSighting& sighting : cell.board.sightings) {
    if (sighting.view != cell.cameras[1].view) continue;
    sighting.frame = cell.board.frames[std::stoul(sighting.frame) % 20];
  }
  EXPECT_THAT(cell.Calibrate(cell.Pair()).refusal, Optional(HasSubstr("the same instants")));
}

TEST(WeakCalibration, LensesThatBowLinesAreRefusedOrSaid) {
  const Cell bowed = SeenCell(60, 2, -0.25);
  EXPECT_THAT(bowed.Calibrate(bowed.Pair()).refusal, Optional(HasSubstr("camera models")));
  const Cell slightly = SeenCell(60, 2, -0.02);
  const WeakCalibration said = slightly.Calibrate(slightly.Pair());
  ASSERT_FALSE(said.refusal) << *said.refusal;
  EXPECT_THAT(said.warnings, Contains(HasSubstr("lenses bow the lines")));
}

// Corners that are far off, for lack of light say.
ViewPair NoisyPair(const std::vector<NamedCamera>& cameras, size_t frames, uint64_t seed) {
  const BoardFrames board = CarriedBoard(cameras, frames, seed, 0.3);
  return CornersOfPair(board.sightings, cameras[0].view, cameras[1].view);
}

TEST(WeakCalibration, ARefusedMarginSaysWhatWouldDo) {
  const auto cameras = CellCameras();
  const ViewPair pair = NoisyPair(cameras, 6, 8);
  const auto calibrate = [&](int mask, double most_margin) {
    return CalibrateWeakly(pair, SizesOf(cameras[0].model, mask), SizesOf(cameras[1].model, mask),
                           most_margin, 1);
  };
  const WeakCalibration found = calibrate(64, kServersMargin);
  ASSERT_TRUE(found.refusal);
  std::smatch said;
  const std::regex words(
      "Show boards in (about \\d+|many more) places instead of \\d+, .*set margin: (\\S+) under "
      "calibration in cell.yaml, and --max-margin \\2 here, --margin \\2 of "
      "silhouette-db calibration import. .*mask_size at most (\\d+)x\\3 instead of "
      "64x64");
  ASSERT_TRUE(std::regex_search(*found.refusal, said, words)) << *found.refusal;
  EXPECT_FALSE(calibrate(64, std::stod(said[2])).refusal);
  EXPECT_FALSE(calibrate(std::stoi(said[3]), kServersMargin).refusal);
}

TEST(WeakCalibration, NoiseOfTheCornersIsNotTakenForMotion) {
  const auto cameras = CellCameras();
  const WeakCalibration found =
      CalibrateWeakly(NoisyPair(cameras, 80, 8), SizesOf(cameras[0].model, 256),
                      SizesOf(cameras[1].model, 256), kServersMargin, 1);
  EXPECT_THAT(found.refusal, Optional(HasSubstr("by their own noise")));
  EXPECT_THAT(found.refusal, Optional(testing::Not(HasSubstr("Did anything move"))));
}

TEST(WeakCalibration, ATagThatIsThereTwiceIsRefused) {
  Cell cell = SeenCell(2, 4);
  cell.board.sightings.push_back(cell.board.sightings.front());
  EXPECT_THROW(CornersOfPair(cell.board.sightings, cell.board.sightings.front().view, "east"),
               std::invalid_argument);
}

}  // namespace
}  // namespace silhouette
