// SPDX-License-Identifier: Apache-2.0
// Samples for which a robot is driven.
#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "capture/session/reference_images.h"
#include "capture/verification/kept_samples.h"
#include "capture/verification/samples.h"
#include "tests/capture/session/fake_cell.h"
#include "tests/capture/verification/ball_robot.h"

namespace silhouette {
namespace {

TEST(DrivenSamples, ConfigurationThatChanceFindsAgainReplacesNone) {
  FakeCell cell;
  cell.TakeReferences();
  SessionParts parts{.database = cell.database.get(),
                     .travel = &*cell.travel,
                     .robot = CellRobot::Create(cell.database->cell(), cell.robot).value(),
                     .cameras = CellCameras::Create(cell.database->cell(), cell.rig, {}).value(),
                     .references = ReadReferences(*cell.database).value(),
                     .settings = cell.settings,
                     .segmentation = cell.segmentation};
  const DrawnRobot robot = BallRobot({.name = "turn", .lower = -1, .upper = 1},
                                     {.name = "lift", .lower = 0, .upper = 0.5});
  const Eigen::AlignedBox3d workspace(Eigen::Vector3d::Constant(-9), Eigen::Vector3d::Constant(9));
  const auto sampler = [&] {
    return ModelSampler(robot, cell.travel->grid().joints(), workspace, {}, {}, 1);
  };

  const auto kept = OpenKeptSamples(FreshFolder() / "kept", *cell.database, "test").value();
  RobotImage before;
  before.number = *kept->grid().Nearest(*sampler().Next({0, 0}));
  for (const MaskSize size : kept->mask_sizes()) before.masks.emplace_back(size);
  {
    auto writer = *kept->Write("test");
    ASSERT_TRUE(writer.Put(before).ok());
    ASSERT_TRUE(writer.Commit().ok());
  }
  ModelSampler again = sampler();
  std::vector<ModelSample> samples;
  const std::vector<std::string> links = {"base", "arm", "hand"};
  const absl::Status taken = TakeSamples(parts, again, links, 2, "test", *kept, samples, {});
  ASSERT_TRUE(taken.ok()) << taken;
  EXPECT_EQ(samples.size(), 2u);
  EXPECT_EQ(cell.robot.moves.size(), 3u);
  EXPECT_EQ(kept->Read()->size(), 3u);
  EXPECT_EQ((**kept->Read()->Find(before.number)).masks, before.masks);
}

}  // namespace
}  // namespace silhouette
