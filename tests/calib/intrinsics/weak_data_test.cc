// SPDX-License-Identifier: Apache-2.0
// What does not determine the lenses, or contradicts itself, is refused with the mend.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <random>

#include "calib/intrinsics/solve_lenses.h"
#include "tests/calib/intrinsics/synthetic_boards.h"

namespace silhouette {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;

class WeakData : public testing::Test {
 protected:
  std::vector<TagSighting> Look(const BoardMotion& motion) {
    return SightingsOf(cameras_, board_, motion, random_);
  }
  absl::StatusOr<LensSolution> Solve(const std::vector<TagSighting>& sightings) {
    return SolveLenses(LensCamerasOf(cameras_), {board_}, sightings);
  }
  void ExpectRefused(const std::vector<TagSighting>& sightings, absl::StatusCode code,
                     const std::string& words) {
    const auto solution = Solve(sightings);
    EXPECT_EQ(solution.status().code(), code) << solution.status();
    EXPECT_THAT(solution.status().message(), HasSubstr(words));
  }

  // From the frame `first` on the board moved between the images of the two cameras: by `shake`,
  // metres, to either side along each axis.
  std::vector<TagSighting> HeldByHand(int frames, double shake, int first) {
    const auto way = [&] { return random_() % 2 == 0 ? shake : -shake; };
    std::vector<TagSighting> sightings;
    for (int frame = 0; frame < frames; ++frame) {
      Eigen::Isometry3d pose = RandomBoardPose(random_, board_, {});
      for (const char* view : {"cam0", "cam1"}) {
        std::vector<TagSighting> seen;
        AddSightings(cameras_, board_, pose, FrameName(frame), 0.1, random_, seen);
        std::ranges::copy_if(seen, std::back_inserter(sightings),
                             [&](const TagSighting& sighting) { return sighting.view == view; });
        if (frame < first) continue;
        pose.pretranslate(Eigen::Vector3d(way(), way(), way()));
      }
    }
    return sightings;
  }

  std::mt19937 random_{21};
  std::vector<CameraModel> cameras_ = CamerasOnAnArc(2);
  Board board_ = LatticeBoard();
};

constexpr auto kInvalid = absl::StatusCode::kInvalidArgument;
constexpr auto kWeak = absl::StatusCode::kFailedPrecondition;

TEST_F(WeakData, TooFewImages) { ExpectRefused(Look({.frames = 4}), kWeak, "only 4 images"); }

TEST_F(WeakData, BoardsThatAllFaceTheCameraSquarely) {
  // At one distance from one camera that looks straight at it.
  const Eigen::Isometry3d straight(Eigen::Translation3d(0, 0, 1.3));
  cameras_ = {CameraModel(cameras_[0].intrinsics(), straight)};
  std::vector<TagSighting> sightings;
  std::uniform_real_distribution<double> unit(-1, 1);
  for (int frame = 0; frame < 20; ++frame) {
    const Eigen::Isometry3d pose(
        Eigen::Translation3d(-0.28 + 0.5 * unit(random_), -0.2 + 0.35 * unit(random_), 0));
    AddSightings(cameras_, board_, pose, FrameName(frame), 0.1, random_, sightings);
  }
  ExpectRefused(sightings, kWeak, "too few tilts: in only 0 of 20 images");
}

TEST_F(WeakData, BoardsInTheMiddleOfTheImageOnly) {
  const Eigen::Isometry3d far(Eigen::Translation3d(0, 0, 3.5));
  cameras_ = {CameraModel(cameras_[0].intrinsics(), far)};
  ExpectRefused(Look({.frames = 20, .spread = 0.05}), kWeak, "bring the board to its rim");
}

TEST_F(WeakData, CornersOutsideTheImage) {
  auto sightings = Look({.frames = 8});
  sightings[5].corners[0].x() = 1400;
  ExpectRefused(sightings, kInvalid, "lies outside the image of 1280 x 960 pixels");
}

TEST_F(WeakData, ATagThatTheRimCutsIsLeftOut) {
  auto sightings = Look({.frames = 15});
  sightings[5].corners[0].x() = 1282;
  const auto solution = Solve(sightings);
  ASSERT_TRUE(solution.ok()) << solution.status();
  EXPECT_EQ(solution->residuals.size(), 4 * (sightings.size() - 1));
}

TEST_F(WeakData, ATagTwiceInAnImage) {
  auto sightings = Look({.frames = 8});
  sightings.push_back(sightings[3]);
  ExpectRefused(sightings, kInvalid, "occurs twice in the frame");
}

TEST_F(WeakData, MirroredImages) {
  auto sightings = Look({.frames = 8});
  for (TagSighting& sighting : sightings) {
    for (auto& corner : sighting.corners) corner.x() = 1279 - corner.x();
  }
  ExpectRefused(sightings, kInvalid, "the images are mirrored");
}

TEST_F(WeakData, ABoardWhoseIdsRunTheOtherWay) {
  auto sightings = Look({.frames = 8});
  for (TagSighting& sighting : sightings) {
    sighting.tag = sighting.tag / 4 * 4 + 3 - sighting.tag % 4;
  }
  ExpectRefused(sightings, kInvalid, "its ids run from right to left");
}

TEST_F(WeakData, ABoardDescribedWrongly) {
  const auto sightings = Look({.frames = 8});
  board_ = Board({.name = "board", .rows = 4, .columns = 3, .tag_size = 0.08, .gap = 0.08});
  ExpectRefused(sightings, kInvalid, "its rows and columns seem to be exchanged");
  board_ = Board({.name = "board", .rows = 5, .columns = 2, .tag_size = 0.08, .gap = 0.08});
  ExpectRefused(sightings, kInvalid, "its tags do not lie as the description says");
}

TEST_F(WeakData, ABoardOfTooManyTagsForItsGap) {
  board_ = Board({.name = "dust", .rows = 40, .columns = 30, .tag_size = 0.02, .gap = 0.0072});
  ExpectRefused(Look({.frames = 1}), kInvalid, "print a board of fewer tags");
}

TEST_F(WeakData, ViewsWithoutImageSizeAndTagsOfNoBoard) {
  auto sightings = Look({.frames = 8});
  sightings[0].view = "top";
  ExpectRefused(sightings, kInvalid, "the view 'top', but the size of its images is not given");
  sightings = Look({.frames = 8});
  for (TagSighting& sighting : sightings) sighting.family = "tag36h11";
  ExpectRefused(sightings, kInvalid, "none of the tags or corners that were seen is on a board");
}

TEST_F(WeakData, ImagesPairedShiftedByOne) {
  auto sightings = Look({.frames = 14});
  for (TagSighting& sighting : sightings) {
    if (sighting.view != "cam1") continue;
    sighting.frame = FrameName((std::stoi(sighting.frame.substr(5)) + 1) % 14);
  }
  const auto solution = Solve(sightings);
  EXPECT_EQ(solution.status().code(), kInvalid);
  EXPECT_THAT(solution.status().message(),
              AllOf(HasSubstr("'cam0' and 'cam1' do not belong together"),
                    HasSubstr("those of 'cam1' taken 1 frame later"), HasSubstr("looks shifted")));
}

TEST_F(WeakData, AFewImagesPairedWronglyAreUsedForTheLensesOnly) {
  auto sightings = Look({.frames = 20});
  for (TagSighting& sighting : sightings) {
    if (sighting.view != "cam1") continue;
    if (sighting.frame == FrameName(3)) {
      sighting.frame = FrameName(4);
    } else if (sighting.frame == FrameName(4)) {
      sighting.frame = FrameName(3);
    }
  }
  const auto solution = Solve(sightings);
  ASSERT_TRUE(solution.ok()) << solution.status();
  EXPECT_THAT(solution->warnings, Contains(HasSubstr("frame 'frame003': 'cam1' saw the board "
                                                     "elsewhere than the others did")));
  EXPECT_NEAR(solution->cameras[1].rms, 0.1, 0.01);
  EXPECT_EQ(solution->cameras[1].images, 20);
}

TEST_F(WeakData, ManyCornersThatAreFarOffSpeakAgainstALensThatUsesThem) {
  auto sightings = Look({.frames = 25});
  std::uniform_real_distribution<double> turn(0, 2 * std::numbers::pi);
  for (size_t i = 0; i < sightings.size(); ++i) {
    for (size_t k = 0; k < sightings[i].corners.size(); ++k) {
      if ((i + k) % 3 != 0) continue;
      const double angle = turn(random_);
      sightings[i].corners[k] += 0.9 * Eigen::Vector2d(std::cos(angle), std::sin(angle));
    }
  }
  std::erase_if(sightings, [](const TagSighting& sighting) {
    return std::ranges::any_of(sighting.corners, [](const Eigen::Vector2d& at) {
      return at.minCoeff() < 0 || at.x() > 1279 || at.y() > 959;
    });
  });
  ExpectRefused(sightings, kInvalid, "corners had to be left out");
}

TEST_F(WeakData, ImagesThatWereNotTakenAtOneInstantAreRefused) {
  const auto sightings = HeldByHand(40, 0.0005, 0);
  const auto together = Solve(sightings);
  EXPECT_EQ(together.status().code(), kWeak) << together.status();
  EXPECT_THAT(std::string(together.status().message()),
              AllOf(HasSubstr("'cam0', 'cam1' saw in one frame were not at one place"),
                    HasSubstr("intrinsics --not-simultaneous")));
  const auto apart =
      SolveLenses(LensCamerasOf(cameras_), {board_}, sightings, {.simultaneous = false});
  ASSERT_TRUE(apart.ok()) << apart.status();
  EXPECT_EQ(apart->groups.size(), 2u);
  EXPECT_THAT(apart->warnings, Contains(HasSubstr("each camera was solved by itself")));
  for (size_t i = 0; i < cameras_.size(); ++i) {
    const SolvedCamera& camera = apart->cameras[i];
    EXPECT_NEAR(camera.rms, 0.1, 0.01);
    EXPECT_NEAR(camera.intrinsics[0] / cameras_[i].intrinsics().fx, 1,
                4 * camera.focal_length_sigma);
  }
}

TEST_F(WeakData, TheFramesThatWereNotTakenAtOneInstantAreNamed) {
  ExpectRefused(HeldByHand(40, 0.003, 38), kWeak,
                "2 of 40 boards that several of 'cam0', 'cam1' saw");
  // Too little to spoil the lenses.
  const auto solution = Solve(HeldByHand(40, 0.0005, 38));
  ASSERT_TRUE(solution.ok()) << solution.status();
  EXPECT_THAT(solution->warnings, Contains(AllOf(HasSubstr("were not at one place: 'frame03"),
                                                 HasSubstr("leave these frames out"))));
}

TEST_F(WeakData, AnImageOfAnotherSizeIsLeftOutAndManyAreRefused) {
  const auto shrink = [](std::vector<TagSighting> sightings, int below) {
    for (TagSighting& sighting : sightings) {
      if (sighting.view != "cam0" || sighting.frame >= FrameName(below)) continue;
      for (auto& corner : sighting.corners) corner *= 0.5;
    }
    return sightings;
  };
  const auto sightings = Look({.frames = 20});
  const auto solution = Solve(shrink(sightings, 1));
  ASSERT_TRUE(solution.ok()) << solution.status();
  EXPECT_THAT(solution->warnings, Contains(HasSubstr("the frame 'frame000' fits far worse")));
  EXPECT_EQ(solution->cameras[0].images, 19);
  EXPECT_NEAR(solution->cameras[0].rms, 0.1, 0.01);
  ExpectRefused(shrink(sightings, 8), kInvalid, "may be of several sizes");
}

TEST_F(WeakData, CopiesOfAnImageCountOnce) {
  auto sightings = Look({.frames = 15});
  const size_t all = sightings.size();
  for (size_t i = 0; i < all; ++i) {
    if (sightings[i].frame != FrameName(2)) continue;
    sightings.push_back(sightings[i]);
    sightings.back().frame = "copy";
  }
  const auto solution = Solve(sightings);
  ASSERT_TRUE(solution.ok()) << solution.status();
  EXPECT_THAT(solution->warnings,
              Contains(HasSubstr("the frame 'copy' shows exactly what 'frame002' shows")));
  EXPECT_EQ(solution->cameras[0].images, 15);
}

TEST_F(WeakData, CamerasThatSawNoBoardTogetherAreSolvedApartAndNamed) {
  auto sightings = Look({.frames = 40});
  std::erase_if(sightings, [](const TagSighting& sighting) {
    return (std::stoi(sighting.frame.substr(5)) % 2 == 0) == (sighting.view == "cam0");
  });
  const auto solution = Solve(sightings);
  ASSERT_TRUE(solution.ok()) << solution.status();
  EXPECT_EQ(solution->groups.size(), 2u);
  EXPECT_THAT(solution->warnings,
              Contains(HasSubstr("no board was seen at once by 'cam0' and by 'cam1'")));
}

}  // namespace
}  // namespace silhouette
