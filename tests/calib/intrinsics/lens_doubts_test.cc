// SPDX-License-Identifier: Apache-2.0
#include "calib/intrinsics/lens_doubts.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <map>
#include <random>
#include <utility>

#include "tests/calib/intrinsics/synthetic_boards.h"

namespace silhouette {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

Board AprilGridWithGap(double gap) {
  return Board({.name = "grid",
                .family = "tag36h11b2",
                .rows = 4,
                .columns = 4,
                .tag_size = 0.08,
                .gap = gap * 0.08,
                .from_bottom = true});
}

// Frames of one camera, called `prefix` and their number.
std::vector<TagSighting> SeenBy(const CameraModel& camera, const Board& board, int frames,
                                const std::string& prefix, unsigned seed) {
  std::mt19937 random(seed);
  std::vector<TagSighting> sightings;
  const BoardMotion motion{.frames = frames, .spread = 0.35};
  for (int i = 0; i < frames; ++i) {
    AddSightings({camera}, board, RandomBoardPose(random, board, motion), prefix + FrameName(i),
                 0.02, random, sightings);
  }
  return sightings;
}

absl::Status FitOf(const Board& board, const std::vector<TagSighting>& sightings) {
  const std::vector<LensCamera> cameras = LensCamerasOf(CamerasOnAnArc(1));
  const auto solution = SolveLenses(cameras, {board}, sightings);
  if (!solution.ok()) return solution.status();
  return CheckFit(cameras, {board}, sightings, {}, *solution);
}

TEST(LensDoubts, AnotherGapBetweenTagsIsNamed) {
  const auto sightings = SeenBy(CamerasOnAnArc(1)[0], AprilGridWithGap(0.3), 20, "", 1);
  EXPECT_EQ(WrongGaps({AprilGridWithGap(0.3)}, sightings), "");
  EXPECT_THAT(WrongGaps({AprilGridWithGap(0.25)}, sightings),
              HasSubstr("about 0.30 of a tag (24 mm), not 0.25 (20 mm)"));
  EXPECT_TRUE(FitOf(AprilGridWithGap(0.3), sightings).ok());
  EXPECT_FALSE(FitOf(AprilGridWithGap(0.25), sightings).ok());
}

Board GridFrom(int first_id) {
  BoardDescription d = AprilGridWithGap(0.3).description();
  d.first_id = first_id;
  return Board(d);
}

TEST(LensDoubts, AFirstIdThatIsOffIsNamedAndTheRightOneIsTaken) {
  const auto sightings = SeenBy(CamerasOnAnArc(1)[0], GridFrom(5), 20, "", 6);
  EXPECT_TRUE(CheckFirstIds({GridFrom(5)}, sightings).ok());
  for (const int stated : {3, 4, 6, 7}) {
    EXPECT_THAT(std::string(CheckFirstIds({GridFrom(stated)}, sightings).message()),
                HasSubstr("(Kalibr's codeOffset) is 5, not " + std::to_string(stated)));
  }
  EXPECT_TRUE(CheckFirstIds({GridFrom(1)}, sightings).ok()) << "rows are whole: a row lower";
}

TEST(LensDoubts, ImagesOfAnotherCameraAmongThemAreNamed) {
  const Board board = LatticeBoard();
  const CameraModel camera = CamerasOnAnArc(1)[0];
  CameraIntrinsics other = camera.intrinsics();
  other.fx *= 1.1;
  other.fy *= 1.1;
  other.cx -= 60;
  other.distortion[0] += 0.1;
  std::vector<TagSighting> sightings = SeenBy(camera, board, 20, "a", 2);
  const auto others = SeenBy(CameraModel(other, camera.camera_from_world()), board, 20, "b", 3);
  sightings.insert(sightings.end(), others.begin(), others.end());
  EXPECT_THAT(FitOf(board, sightings).message(),
              AllOf(HasSubstr("of another camera, zoom or focus"), HasSubstr("b" + FrameName(3)),
                    Not(HasSubstr("a" + FrameName(3)))));
}

// Two zooms by turns or one, with any stated sigma.
std::string VerdictAt(double sigma, double zoom) {
  const Board board = LatticeBoard();
  const CameraModel camera = CamerasOnAnArc(1)[0];
  CameraIntrinsics other = camera.intrinsics();
  other.fx *= zoom;
  other.fy *= zoom;
  other.cx += 100 * (zoom - 1);
  std::vector<TagSighting> sightings = SeenBy(camera, board, 20, "a", 2);
  const auto others = SeenBy(CameraModel(other, camera.camera_from_world()), board, 20, "b", 3);
  sightings.insert(sightings.end(), others.begin(), others.end());
  for (TagSighting& seen : sightings) seen.sigma = sigma;
  return std::string(FitOf(board, sightings).message());
}

TEST(LensDoubts, TheVerdictIsTheSameForAnyStatedSigma) {
  for (const double zoom : {1.0, 1.1}) {
    const std::string verdict = VerdictAt(0.02, zoom);
    EXPECT_EQ(verdict.empty(), zoom == 1.0) << verdict;
    for (const double sigma : {0.005, 0.2, 0.5}) {
      EXPECT_EQ(VerdictAt(sigma, zoom), verdict) << sigma << " px, zoom " << zoom;
    }
  }
}

TEST(LensDoubts, APrintThatIsOffByTenthsOfAPixelIsTaken) {
  const Board board = LatticeBoard();
  std::vector<TagSighting> sightings = SeenBy(CamerasOnAnArc(1)[0], board, 30, "", 4);
  std::mt19937 random(5);
  std::normal_distribution<double> normal(0, 0.5);
  std::map<std::pair<int, size_t>, Eigen::Vector2d> print;
  for (TagSighting& seen : sightings) {
    for (size_t i = 0; i < seen.corners.size(); ++i) {
      const auto [shift, added] =
          print.emplace(std::pair(seen.tag, i), Eigen::Vector2d(normal(random), normal(random)));
      seen.corners[i] += shift->second;
    }
  }
  EXPECT_TRUE(FitOf(board, sightings).ok()) << FitOf(board, sightings);
}

}  // namespace
}  // namespace silhouette
