// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <map>

#include "capture/sim/simulation.h"
#include "capture/sim/tag_projection.h"
#include "tests/random.h"

namespace silhouette {
namespace {

Board SmallBoard() {
  return Board({.name = "board", .rows = 3, .columns = 4, .tag_size = 0.08, .gap = 0.08});
}

std::vector<NamedCamera> FourCameras() {
  const CameraIntrinsics intrinsics{.width = 1280,
                                    .height = 960,
                                    .fx = 905,
                                    .fy = 903,
                                    .cx = 640,
                                    .cy = 470,
                                    .distortion = {-0.2, 0.05, 0.001, -0.001, 0}};
  std::vector<NamedCamera> cameras;
  for (const double x : {-1.2, 1.2}) {
    for (const double y : {-1.2, 1.2}) {
      cameras.push_back(
          {"view" + std::to_string(cameras.size()),
           CameraModel(intrinsics, LookAt({x, y, 2.4}, {0, 0, 0.5}, Eigen::Vector3d::UnitZ()))});
    }
  }
  return cameras;
}

TEST(TagProjection, WithoutNoiseCornersAreThoseOfTheModel) {
  const auto cameras = FourCameras();
  const Board board = SmallBoard();
  Eigen::Isometry3d pose(Eigen::Translation3d(0, 0, 0.6));
  pose.linear() << 1, 0, 0, 0, -1, 0, 0, 0, -1;  // lies there, its front upward
  Chance chance(1);
  const auto seen = ProjectTags(cameras[0], "f", board, pose, {.sigma = 0}, chance);
  ASSERT_EQ(seen.size(), 12u);
  for (const TagSighting& sighting : seen) {
    for (size_t i = 0; i < 4; ++i) {
      const auto pixel = cameras[0].model.Project(pose * board.CornersOf(sighting.tag)[i]);
      EXPECT_EQ(sighting.corners[i], *pixel);
    }
    EXPECT_EQ(sighting.family, "tagStandard41h12");
    EXPECT_GT(sighting.sigma, 0);
  }
}

TEST(TagProjection, BackOfABoardIsNotSeen) {
  const Board board = SmallBoard();
  Chance chance(1);
  const Eigen::Isometry3d face_down(Eigen::Translation3d(0, 0, 0.6));
  EXPECT_TRUE(ProjectTags(FourCameras()[0], "f", board, face_down, {}, chance).empty());
}

TEST(TagProjection, TagsBeyondTheImageOrTooSmallAreNotSeen) {
  const auto cameras = FourCameras();
  const Board board = SmallBoard();
  Chance chance(1);
  Eigen::Isometry3d pose(Eigen::Translation3d(0, 0, 0.6));
  pose.linear() << 1, 0, 0, 0, -1, 0, 0, 0, -1;
  EXPECT_TRUE(ProjectTags(cameras[0], "f", board, pose, {.least_size = 60}, chance).empty());
  pose.translation() << 3, 3, 0.6;
  EXPECT_TRUE(ProjectTags(cameras[3], "f", board, pose, {.least_size = 1}, chance).empty());
}

TEST(TagProjection, FramesAreSeenByAsManyViewsAsAskedAndSpreadOverTheImages) {
  const uint64_t seed = Random()();
  const auto cameras = FourCameras();
  const BoardPlaces places{
      .volume = {Eigen::Vector3d(-0.6, -0.6, 0.2), Eigen::Vector3d(0.6, 0.6, 1)}, .least_views = 2};
  const BoardFrames drawn =
      DrawBoardFrames(cameras, SmallBoard(), places, 40, {.sigma = 0.1}, seed);
  ASSERT_EQ(drawn.frames.size(), 40u);
  ASSERT_EQ(drawn.world_from_board.size(), 40u);
  std::map<std::string, std::map<std::string, int>> tags;
  Eigen::AlignedBox2d spread;
  double squares = 0;
  size_t corners = 0;
  for (const TagSighting& sighting : drawn.sightings) {
    ++tags[sighting.frame][sighting.view];
    const size_t frame = static_cast<size_t>(std::stoi(sighting.frame)) - 1;
    const auto& camera = cameras.at(static_cast<size_t>(sighting.view.back() - '0')).model;
    for (size_t i = 0; i < 4; ++i) {
      const auto true_pixel =
          camera.Project(drawn.world_from_board[frame] * SmallBoard().CornersOf(sighting.tag)[i]);
      squares += (sighting.corners[i] - *true_pixel).squaredNorm();
      ++corners;
      spread.extend(sighting.corners[i]);
    }
  }
  EXPECT_NEAR(std::sqrt(squares / static_cast<double>(2 * corners)), 0.1, 0.01);
  EXPECT_GT(spread.sizes().x(), 700);
  EXPECT_GT(spread.sizes().y(), 500);
  for (const auto& [frame, views] : tags) {
    int well_seen = 0;
    for (const auto& [view, count] : views) well_seen += count >= 6 ? 1 : 0;
    EXPECT_GE(well_seen, 2) << frame;
  }
  // The same seed gives the same.
  const BoardFrames again =
      DrawBoardFrames(cameras, SmallBoard(), places, 40, {.sigma = 0.1}, seed);
  EXPECT_EQ(again.sightings.back().corners, drawn.sightings.back().corners);
}

TEST(TagProjection, VolumeThatNoCameraSeesIsAMistake) {
  const BoardPlaces behind{.volume = {Eigen::Vector3d(9, 9, 9), Eigen::Vector3d(10, 10, 10)}};
  EXPECT_THROW(DrawBoardFrames(FourCameras(), SmallBoard(), behind, 1, {}, 1),
               std::invalid_argument);
}

}  // namespace
}  // namespace silhouette
