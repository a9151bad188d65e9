// SPDX-License-Identifier: Apache-2.0
// silhouette-sim serve: where the robot stands before anything moves it.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "capture/drivers/grpc/grpc_robot_link.h"
#include "capture/drivers/robots/feedback_robot.h"
#include "tests/capture/drivers/served_process.h"
#include "tests/capture/session/program_cell.h"

namespace silhouette {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

// Where the robot of the cell stands at first.
std::vector<double> FirstPositions(const ProgramCell& cell) {
  const Served served(cell.cell(), {"--robot", "grpc", "--robot-address", "127.0.0.1:0"});
  const absl::Duration timeout = absl::Seconds(60);
  auto link = ConnectGrpcRobot({.address = served.told()["robot"]["address"], .timeout = timeout});
  if (!link.ok()) {
    ADD_FAILURE() << link.status();
    return {};
  }
  FeedbackRobot robot(*std::move(link), {.silence = timeout});
  const auto state = robot.State();
  EXPECT_TRUE(state.ok()) << state.status();
  return state.ok() ? state->positions : std::vector<double>();
}

TEST(Serve, RobotBeginsInTheMiddleOfItsGrid) {
  const std::vector<double> positions = FirstPositions(ProgramCell());
  ASSERT_EQ(positions.size(), 6);
  EXPECT_NEAR(positions[0], 0, 1e-3);
  EXPECT_NEAR(positions[2], -5 * kDegree, 1e-3);
}

TEST(Serve, RobotBeginsBesideTheMiddleWhereThatIsForbidden) {
  ProgramCell cell;
  cell.WriteCell({{"capture:\n",
                   "capture:\n"
                   "  forbidden_regions:\n"
                   "    - {name: pillar, joints: {joint_1: [-10 deg, 10 deg]}}\n"}});
  const std::vector<double> positions = FirstPositions(cell);
  ASSERT_EQ(positions.size(), 6);
  EXPECT_NEAR(std::abs(positions[0]), 37.5 * kDegree, 1e-3) << "one step beside the middle";
  EXPECT_NEAR(positions[2], -5 * kDegree, 1e-3);
}

}  // namespace
}  // namespace silhouette
