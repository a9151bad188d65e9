// SPDX-License-Identifier: Apache-2.0
#include "calib/fundamental/tag_drift.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <random>

namespace silhouette {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using testing::ElementsAre;
using testing::HasSubstr;

constexpr double kFocal = 400;  // pixels, of images of 320 x 240
constexpr double kNoise = 0.03;
constexpr double kLimit = 0.2;  // mask pixels
const ViewSizes kSizes{.image = {320, 240}, .mask = {64, 64}};

Vector2d Seen(const Isometry3d& camera_from_cell, const Vector3d& point, double focal = kFocal) {
  const Vector3d at = camera_from_cell * point;
  return Vector2d(159.5, 119.5) + focal * at.head<2>() / at.z();
}

// Tags of 0.2 m on the floor, 3 to 4 m before the camera, but for those that are `elsewhere_`.
struct TagDriftTest : testing::Test {
  std::mt19937 random{1};
  double row_step_ = 0.7;  // metres, by which the second row is farther
  std::map<int, Vector3d> elsewhere_;

  std::map<SeenTag, TagSighting> Look(const Isometry3d& camera_from_cell, int tags,
                                      double focal = kFocal) {
    std::normal_distribution<double> noise(0, kNoise);
    std::map<SeenTag, TagSighting> seen;
    for (int tag = 0; tag < tags; ++tag) {
      TagSighting sighting{.frame = "", .view = "left", .family = "f", .tag = tag, .sigma = kNoise};
      Vector3d at(-1 + 0.9 * (tag % 3), 0.7 - 0.8 * (tag / 3), 3.2 + row_step_ * (tag / 3));
      if (const auto other = elsewhere_.find(tag); other != elsewhere_.end()) at = other->second;
      for (const Vector2d& corner : {Vector2d(0, 0), {0.2, 0}, {0.2, 0.2}, {0, 0.2}}) {
        const Vector3d point = at + Vector3d(corner.x(), corner.y(), 0);
        sighting.corners.push_back(Seen(camera_from_cell, point, focal) +
                                   Vector2d(noise(random), noise(random)));
      }
      seen.emplace(SeenTag{"left", "f", tag}, sighting);
    }
    return seen;
  }

  ViewDrift Drift(const Isometry3d& moved, int tags = 6, double focal = kFocal) {
    return DriftByTags("left", kSizes, Look(Isometry3d::Identity(), tags),
                       Look(moved, tags, focal));
  }
};

// Of points of the workspace, which is nearer than the floor.
double TrueMotion(const Isometry3d& moved) {
  double most = 0;
  for (const double z : {2.4, 3.4}) {
    for (const double x : {-0.5, 0.5}) {
      for (const double y : {-0.5, 0.5}) {
        const Vector2d motion = Seen(moved, {x, y, z}) - Seen(Isometry3d::Identity(), {x, y, z});
        most = std::max(most, motion.cwiseProduct(Vector2d(64.0 / 320, 64.0 / 240)).norm());
      }
    }
  }
  return most;
}

TEST_F(TagDriftTest, CameraThatStandsIsConfirmed) {
  for (int i = 0; i < 100; ++i) {
    EXPECT_LT(Drift(Isometry3d::Identity()).moved_mask, 0.6 * kLimit);
  }
}

TEST_F(TagDriftTest, CameraThatWasCarriedMovedAsFarAsItMovesTheWorkspace) {
  for (const Vector3d& way : {Vector3d(0, 0, 0.05), {0, 0, -0.05}, {0.02, 0, 0}, {0, 0.02, 0.02}}) {
    for (int i = 0; i < 20; ++i) {
      // Turned back, so that the tags' images stay about where they were.
      Isometry3d moved = Isometry3d::Identity();
      moved.rotate(Eigen::AngleAxisd(way.x() / 3.5, -Vector3d::UnitY()));
      moved.rotate(Eigen::AngleAxisd(way.y() / 3.5, Vector3d::UnitX()));
      moved.pretranslate(way);
      EXPECT_GT(Drift(moved).moved_mask, 0.8 * TrueMotion(moved)) << way.transpose();
    }
  }
}

TEST_F(TagDriftTest, CameraCarriedAndTurnedBackIsRarelyConfirmed) {
  std::normal_distribution<double> any;
  for (const double step : {0.7, 0.0}) {  // 0: a plane that faces the camera shows least
    row_step_ = step;
    // It stays where it was in the image.
    const Vector3d middle(0, 0.3, 3.2 + step / 2);
    int moved = 0;
    int confirmed = 0;
    for (int i = 0; i < 400; ++i) {
      Vector3d way(any(random), any(random), any(random));
      way *= 0.01 * (1 + i % 3) / way.norm();
      Isometry3d motion(Eigen::Quaterniond::FromTwoVectors(middle + way, middle));
      motion.translate(way);
      if (TrueMotion(motion) < kLimit) continue;
      ++moved;
      confirmed += Drift(motion).moved_mask <= kLimit ? 1 : 0;
    }
    EXPECT_GT(moved, 150);
    EXPECT_LE(confirmed, moved / 100);
  }
}

// Turned back, so that the far tags stay where they were in the image.
TEST_F(TagDriftTest, CameraCarriedPastANearTagIsNotConfirmed) {
  elsewhere_ = {{0, {-1.5, 1, 5}}, {1, {0, 1, 5}}, {2, {1.3, 1, 5}}, {3, {-0.1, -0.3, 1.2}}};
  for (const double way : {0.008, 0.012, 0.02}) {
    Isometry3d moved(Eigen::AngleAxisd(way / 5, -Vector3d::UnitY()));
    moved.pretranslate(Vector3d(way, 0, 0));
    for (int i = 0; i < 50; ++i) {
      const ViewDrift drift = Drift(moved, 4);
      EXPECT_FALSE(drift.checked);
      EXPECT_GT(drift.moved_mask, TrueMotion(moved));
      EXPECT_EQ(drift.corners, 16) << "all count";
      EXPECT_THAT(drift.odd_tags, ElementsAre(SeenTag("left", "f", 3)));
      EXPECT_THAT(drift.message,
                  HasSubstr("tag 3 of f moved by itself, or the camera was carried: put it back"));
    }
  }
}

TEST_F(TagDriftTest, AnOddTagIsNamedWithItsFamily) {
  std::map<SeenTag, TagSighting> before = Look(Isometry3d::Identity(), 3);
  for (auto [key, sighting] : Look(Isometry3d::Identity(), 3)) {
    sighting.family = "g";
    before.emplace(SeenTag("left", "g", sighting.tag), sighting);
  }
  std::map<SeenTag, TagSighting> after = before;
  for (Vector2d& corner : after.at({"left", "g", 1}).corners) corner.x() += 3;
  const ViewDrift drift = DriftByTags("left", kSizes, before, after);
  EXPECT_FALSE(drift.checked);
  EXPECT_THAT(drift.odd_tags, ElementsAre(SeenTag("left", "g", 1)));
  EXPECT_THAT(drift.message, HasSubstr("tag 1 of g moved by itself"));
}

TEST_F(TagDriftTest, CornersOfTheCalibrationItselfAreNotChecked) {
  const std::map<SeenTag, TagSighting> seen = Look(Isometry3d::Identity(), 6);
  const ViewDrift drift = DriftByTags("left", kSizes, seen, seen);
  EXPECT_FALSE(drift.checked);
  EXPECT_THAT(drift.message, HasSubstr("the images are not new"));
  EXPECT_TRUE(DriftByTags("left", kSizes, seen, seen, /*has_noise=*/false).checked);
}

TEST_F(TagDriftTest, ATagThatMovesBetweenFramesHasNoMeanUnlessTheMaskIsTooCoarseToShowIt) {
  std::vector<TagSighting> frames;
  for (const int frame : {1, 2}) {
    frames.push_back({.frame = std::to_string(frame),
                      .view = "left",
                      .family = "f",
                      .tag = 7,
                      .corners = {Vector2d(100 + 2 * frame, 50)},
                      .sigma = kNoise});
  }
  EXPECT_THAT(std::string(MeanSightings("left", kSizes, frames).status().message()),
              HasSubstr("'left' saw tag 7 of f move between the frames '1' and '2'"));
  EXPECT_FALSE(MeanSightings("left", {.image = kSizes.image, .mask = {}}, frames).ok());
  EXPECT_TRUE(MeanSightings("right", kSizes, frames)->empty());
  const ViewSizes coarse{.image = {3840, 2160}, .mask = {64, 36}};  // 2 px are 0.03 mask pixels
  ASSERT_TRUE(MeanSightings("left", coarse, frames).ok());
  EXPECT_EQ(MeanSightings("left", coarse, frames)->begin()->second.corners[0], Vector2d(103, 50));
}

TEST_F(TagDriftTest, ChangedFocusCounts) {
  const ViewDrift drift = Drift(Isometry3d::Identity(), 6, 1.008 * kFocal);
  EXPECT_NEAR(drift.scale, 0.008, 0.001);
  EXPECT_GT(drift.moved, 0.008 * 200) << "in the image's corners";
}

TEST_F(TagDriftTest, TurnAboutTheOnlyTagIsNotConfirmed) {
  const Vector3d tag = Vector3d(-0.9, 0.8, 3.2).normalized();
  for (int i = 0; i < 20; ++i) {
    const Isometry3d turned(Eigen::AngleAxisd(0.5 * EIGEN_PI / 180, tag));
    EXPECT_GT(Drift(turned, 1).moved_mask, kLimit);
  }
}

}  // namespace
}  // namespace silhouette
