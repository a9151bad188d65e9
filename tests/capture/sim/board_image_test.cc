// SPDX-License-Identifier: Apache-2.0
// Boards of tags as the simulated cameras see them.
#include <gtest/gtest.h>

#include <cmath>

#include "capture/sim/chance.h"
#include "capture/sim/simulated_board.h"
#include "tests/capture/sim/small_cell.h"
#include "tests/random.h"

namespace silhouette {
namespace {

Board Wall() { return Board({.name = "wall", .tag_size = 0.5, .first_id = 3}); }

// The frame's rotation of a board whose front looks along the world's x, upright.
Eigen::Isometry3d FacingX(const Eigen::Vector3d& origin) {
  Eigen::Isometry3d pose(Eigen::Translation3d{origin});
  pose.linear() << 0, 0, -1, 1, 0, 0, 0, -1, 0;
  return pose;
}

// The camera "front" stands at (3, 0, 1) and looks along -x.
SimulationSettings WithWall(const std::optional<Eigen::Isometry3d>& pose) {
  SimulationSettings settings = SmallSimulation();
  settings.cameras[1] = {"front",
                         CameraModel({.width = 160,
                                      .height = 120,
                                      .fx = 180,
                                      .fy = 190,
                                      .cx = 81,
                                      .cy = 58,
                                      .distortion = {-0.2, 0.05, 0.002, -0.001, 0.01}},
                                     LookAt({3, 0, 1}, {0, 0, 1}, Eigen::Vector3d::UnitZ()))};
  settings.boards.push_back({.board = Wall(), .margin = 0.05, .pose = pose});
  return settings;
}

std::vector<CameraImage> Take(SimulatedCell& cell) {
  cell.SetFrame(0);
  return cell.TakeImages(std::vector<size_t>{0, 1});
}

int Differing(const CameraImage& a, const CameraImage& b) {
  int count = 0;
  for (size_t i = 0; i < a.pixels.size(); ++i) count += a.pixels[i] != b.pixels[i] ? 1 : 0;
  return count;
}

// The part of a pixel's area that is black, from 40 x 40 exact rays; nothing if not all of it is
// the board's paper.
std::optional<double> BlackByRays(const CameraModel& camera, const BoardTexture& texture,
                                  const Eigen::Isometry3d& world_from_board, int x, int y) {
  constexpr int kSteps = 40;
  const Eigen::Vector3d centre = world_from_board.inverse() * camera.Centre();
  double black = 0;
  for (int i = 0; i < kSteps * kSteps; ++i) {
    const double u = x - 0.5 + (i % kSteps + 0.5) / kSteps;
    const double v = y - 0.5 + (i / kSteps + 0.5) / kSteps;
    const Eigen::Vector3d ray = world_from_board.linear().transpose() * *camera.Ray({u, v});
    const Eigen::Vector3d point = centre - centre.z() / ray.z() * ray;
    if (!texture.extent().contains(point.head<2>())) return std::nullopt;
    black += texture.IsBlack(point.head<2>()) ? 1 : 0;
  }
  return black / (kSteps * kSteps);
}

TEST(BoardImage, PixelsShowTheShareOfBlackInTheirArea) {
  Chance chance{Random()()};
  Eigen::Isometry3d pose = FacingX({1, -0.25, 1.25});
  pose.rotate(Eigen::AngleAxisd(chance.Uniform(-0.5, 0.5), chance.Direction()));
  SimulatedCell cell(ThreeJointRobot(), WithWall(pose));
  cell.SetRobotPresent(false);
  const CameraImage image = Take(cell)[1];
  const CameraModel& camera = cell.settings().cameras[1].model;
  const BoardTexture texture(Wall(), 0.05);
  int darkest = 255;
  int brightest = 0;
  std::vector<std::pair<double, int>> pixels;  // share of black, level
  for (int y = 0; y < image.height; y += 3) {
    for (int x = 0; x < image.width; x += 3) {
      const auto black = BlackByRays(camera, texture, pose, x, y);
      if (!black) continue;
      pixels.emplace_back(*black, PixelAt(image, Eigen::Vector2d(x, y)));
      darkest = std::min(darkest, pixels.back().second);
      brightest = std::max(brightest, pixels.back().second);
    }
  }
  ASSERT_GT(pixels.size(), 100u);
  ASSERT_GT(brightest - darkest, 60);
  int mixed = 0;
  for (const auto& [black, level] : pixels) {
    EXPECT_NEAR(level, brightest + black * (darkest - brightest), 2.5);
    mixed += black > 0.1 && black < 0.9 ? 1 : 0;
  }
  EXPECT_GT(mixed, 3);
}

TEST(BoardImage, WhatStandsInFrontHidesTheBoard) {
  SimulatedCell with(ThreeJointRobot(), WithWall(FacingX({0, -0.25, 1.25})));
  SimulatedCell without(ThreeJointRobot(), WithWall(std::nullopt));
  for (SimulatedCell* cell : {&with, &without}) {
    cell->SetRobotPresent(false);
    cell->SetObstacles({BoxAt("screen", {0.1, 0.2, 3}, {1, 0, 1})});
  }
  const auto a = Take(with);
  const auto b = Take(without);
  EXPECT_GT(Differing(a[1], b[1]), 500);
  // The middle of the image is the screen's, left and right of it the board is seen.
  for (int y = 45; y < 75; ++y) {
    for (int x = 75; x < 86; ++x) {
      ASSERT_EQ(PixelAt(a[1], Eigen::Vector2d(x, y)), PixelAt(b[1], Eigen::Vector2d(x, y)));
    }
  }
}

TEST(BoardImage, BackOfABoardIsPlain) {
  Eigen::Isometry3d turned = FacingX({0, -0.25, 1.25});
  turned.rotate(Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitY()));
  turned.pretranslate(Eigen::Vector3d(0, 0.5, 0));
  SimulatedCell cell(ThreeJointRobot(), WithWall(turned));
  cell.SetRobotPresent(false);
  const CameraImage image = Take(cell)[1];
  const CameraModel& camera = cell.settings().cameras[1].model;
  const int middle = PixelAt(image, *camera.Project({0, 0, 1}));
  EXPECT_GT(middle, 60);
  for (const double offset : {-0.2, -0.1, 0.1, 0.2}) {
    EXPECT_EQ(PixelAt(image, *camera.Project({0, offset, 1 - offset})), middle);
  }
}

TEST(BoardImage, BoardOnALinkGoesWhereTheRobotGoes) {
  SimulationSettings settings = WithWall(FacingX({0.3, 0, 0}));
  settings.boards[0].link = "forearm";
  SimulatedCell cell(ThreeJointRobot(), settings);
  for (const std::vector<double>& positions : {std::vector<double>{0, 0, 0}, {0.7, -0.4, 0.1}}) {
    cell.SetPositions(positions);
    const Poses links = cell.robot().LinkPoses(positions);
    ASSERT_TRUE(cell.BoardPoses()[0].has_value());
    EXPECT_TRUE(cell.BoardPoses()[0]->isApprox(links[2] * *settings.boards[0].pose));
  }
  const auto with = Take(cell);
  cell.SetRobotPresent(false);
  EXPECT_FALSE(cell.BoardPoses()[0].has_value());
  EXPECT_GT(Differing(with[1], Take(cell)[1]), 300);
}

TEST(BoardImage, BoardForCalibrationOnlyLeavesOtherImagesAsTheyAre) {
  SimulationSettings settings = WithWall(FacingX({0, -0.25, 1.25}));
  settings.boards[0].always = false;
  SimulatedCell cell(ThreeJointRobot(), settings);
  settings.boards.clear();
  SimulatedCell bare(ThreeJointRobot(), settings);
  const auto hidden = Take(cell);
  const auto truth = Take(bare);
  EXPECT_EQ(hidden[0].pixels, truth[0].pixels);
  EXPECT_EQ(hidden[1].pixels, truth[1].pixels);
  cell.ShowAllBoards(true);
  EXPECT_GT(Differing(Take(cell)[1], truth[1]), 500);
}

TEST(BoardImage, HeldBoardIsSeenWhereItIsHeld) {
  SimulatedCell cell(ThreeJointRobot(), WithWall(std::nullopt));
  EXPECT_FALSE(cell.BoardPoses()[0].has_value());
  const auto before = Take(cell);
  cell.HoldBoard("wall", FacingX({0, -0.25, 1.25}));
  EXPECT_GT(Differing(Take(cell)[1], before[1]), 500);
  cell.HoldBoard("wall", std::nullopt);
  EXPECT_EQ(Take(cell)[1].pixels, before[1].pixels);
  EXPECT_THROW(cell.HoldBoard("door", std::nullopt), std::invalid_argument);
}

TEST(BoardImage, UnknownLinkIsAMistake) {
  SimulationSettings settings = WithWall(FacingX({0, 0, 0}));
  settings.boards[0].link = "hand";
  EXPECT_THROW(SimulatedCell(ThreeJointRobot(), settings), std::invalid_argument);
}

TEST(BoardImage, BlurSoftensEdgesAndKeepsTheirPlace) {
  // An upright edge: its place is the sum of the row's levels, with and without blur.
  SimulationSettings settings = WithWall(FacingX({0, -0.25, 1.25}));
  settings.light.ambient = 1;
  SimulatedCell sharp(ThreeJointRobot(), settings);
  settings.blur = 1.2;
  SimulatedCell soft(ThreeJointRobot(), settings);
  sharp.SetRobotPresent(false);
  soft.SetRobotPresent(false);
  const CameraImage a = Take(sharp)[1];
  const CameraImage b = Take(soft)[1];
  double steepest_a = 0, steepest_b = 0, sum_a = 0, sum_b = 0;
  for (int y = 30; y < 90; ++y) {
    for (int x = 30; x < 130; ++x) {
      const auto step = [&](const CameraImage& image) {
        return std::abs(PixelAt(image, Eigen::Vector2d(x + 1, y)) -
                        PixelAt(image, Eigen::Vector2d(x, y)));
      };
      steepest_a = std::max<double>(steepest_a, step(a));
      steepest_b = std::max<double>(steepest_b, step(b));
      sum_a += PixelAt(a, Eigen::Vector2d(x, y));
      sum_b += PixelAt(b, Eigen::Vector2d(x, y));
    }
  }
  EXPECT_LT(steepest_b, 0.6 * steepest_a);
  EXPECT_NEAR(sum_b / sum_a, 1, 0.01);
}

}  // namespace
}  // namespace silhouette
