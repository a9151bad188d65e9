// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <future>
#include <thread>

#include "tests/capture/sim/small_cell.h"

namespace silhouette {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;

std::shared_ptr<SimulatedCell> Cell(double joint_speed = 0) {
  SimulationSettings settings = SmallSimulation();
  settings.joint_speed = joint_speed;
  return std::make_shared<SimulatedCell>(ThreeJointRobot(), settings);
}

TEST(SimulatedRobot, MovesToWhereItIsTold) {
  const auto cell = Cell();
  SimulatedRobot robot(cell);
  EXPECT_THAT(robot.joints(), ElementsAre("turn", "bend", "slide"));
  ASSERT_TRUE(robot.MoveTo(std::vector<double>{0.5, -0.5, 0.1}).ok());
  const RobotState state = robot.State().value();
  EXPECT_THAT(state.positions, ElementsAre(0.5, -0.5, 0.1));
  EXPECT_FALSE(state.moving);
}

TEST(SimulatedRobot, RefusesWhatItCannotReach) {
  SimulatedRobot robot(Cell());
  EXPECT_EQ(robot.MoveTo(std::vector<double>{0, 0}).code(), absl::StatusCode::kInvalidArgument);
  const absl::Status beyond = robot.MoveTo(std::vector<double>{2.5, 0, 0});
  EXPECT_EQ(beyond.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(beyond.message()), HasSubstr("'turn'"));
  EXPECT_THAT(robot.State()->positions, ElementsAre(0, 0, 0));
}

TEST(SimulatedRobot, StopsOnTheWay) {
  // It would take hours.
  SimulatedRobot robot(Cell(1e-4));
  std::future<absl::Status> move = std::async(std::launch::async, [&] {
    return robot.MoveTo(std::vector<double>{1, 0, 0});
  });
  while (!robot.State()->moving) std::this_thread::yield();
  ASSERT_TRUE(robot.Stop().ok());
  EXPECT_EQ(move.get().code(), absl::StatusCode::kAborted);
  const RobotState state = robot.State().value();
  EXPECT_FALSE(state.moving);
  EXPECT_LT(state.positions[0], 0.5);
}

TEST(SimulatedRobot, ArrivesAtItsSpeed) {
  SimulatedRobot robot(Cell(20));
  ASSERT_TRUE(robot.MoveTo(std::vector<double>{1, 0.5, 0.1}).ok());
  EXPECT_THAT(robot.State()->positions, ElementsAre(1, 0.5, 0.1));
}

TEST(SimulatedCameraRig, GrabsTheViewsInTheirOrder) {
  const auto cell = Cell();
  const std::vector<SimulatedView> views{{"front", 160, 120}, {"top", 160, 120}};
  const auto rig = SimulatedCameraRig::Create(cell, views).value();
  EXPECT_THAT(rig->views(), ElementsAre("front", "top"));
  const auto images = rig->Grab().value();
  ASSERT_EQ(images.size(), 2u);
  EXPECT_EQ(images[0].width, 160);
  EXPECT_EQ(images[0].height, 120);
  EXPECT_EQ(images[0].pixels.size(), 160u * 120u);
  EXPECT_EQ(images[0].captured, images[1].captured);
  EXPECT_NE(images[0].pixels, images[1].pixels);
  const auto swapped = SimulatedCameraRig::Create(
      cell, std::vector<SimulatedView>{{"top", 160, 120}, {"front", 160, 120}});
  EXPECT_EQ((*swapped)->Grab()->at(1).pixels, images[0].pixels);
}

TEST(SimulatedCameraRig, ViewWithoutCameraIsNamed) {
  const auto cell = Cell();
  const auto missing =
      SimulatedCameraRig::Create(cell, std::vector<SimulatedView>{{"side", 160, 120}});
  EXPECT_EQ(missing.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(missing.status().message()),
              AllOf(HasSubstr("'side'"), HasSubstr("'top', 'front'")));
  const auto wrong_size =
      SimulatedCameraRig::Create(cell, std::vector<SimulatedView>{{"top", 320, 240}});
  EXPECT_THAT(std::string(wrong_size.status().message()),
              AllOf(HasSubstr("'top'"), HasSubstr("320 x 240"), HasSubstr("160 x 120")));
}

TEST(SimulatedCell, MovingObstaclesFollowTheTime) {
  const auto cell = Cell();
  Obstacle box = BoxAt("box", {0.3, 0.3, 0.3}, {-1, -1, 1});
  box.velocity = {1, 0, 0};
  cell->SetObstacles({box});
  const std::vector<size_t> top{0};
  const auto at_start = cell->TakeImages(top);
  EXPECT_DOUBLE_EQ(cell->time(), cell->settings().frame_interval);
  cell->SetTime(1);
  const auto later = cell->TakeImages(top);
  EXPECT_NE(at_start[0].pixels, later[0].pixels);
  cell->SetTime(0);
  EXPECT_EQ(cell->TakeImages(top)[0].pixels, at_start[0].pixels);
}

}  // namespace
}  // namespace silhouette
