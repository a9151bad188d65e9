// SPDX-License-Identifier: Apache-2.0
// The bars of the segmentation, in a few scenes of the demo's cell.
#include "tools/silhouette-experiments/segmentation/study.h"

#include <gtest/gtest.h>

namespace silhouette::segmentation_experiment {
namespace {

const std::string kFolder = std::string(SILHOUETTE_SOURCE_DIR) + "/capture/sim/";

Workplace Demo() {
  const auto simulation = LoadSimulation(kFolder + "cells/demo/simulation.yaml");
  const auto robot = RobotModel::FromUrdf(kFolder + "robots/rx130.urdf", {});
  Workplace workplace{
      .robot = robot.value(),
      .simulation = simulation.value(),
      .cameras = {0, 3},
      .masks = {{64, 64}, {64, 64}},
      .positions = std::vector<double>(robot->joints().size()),
      .moving = {*robot->JointIndex("joint_1")},
      .grid = ConfigurationGrid({{.name = "joint_1", .lower = -2.6, .upper = 2.6, .steps = 53}})};
  workplace.simulation.boards.clear();
  return workplace;
}

std::vector<Figures> MeasureDemo(bool colour, const Condition& condition) {
  const StudySettings settings{.scenes = 3, .seed = 5, .colour = colour};
  return Measure(Demo(), condition, Methods(), settings, [] { return false; });
}

TEST(SegmentationStudy, ColourFindsEverythingAndNothingElse) {
  for (const Condition& condition : Conditions()) {
    if (condition.name == "noise 3") continue;
    const Figures figures = MeasureDemo(true, condition)[0];
    ASSERT_GT(figures.obstacle_mask, 300);
    EXPECT_GE(figures.recall(), 0.999) << condition.name;
    EXPECT_LT(figures.false_share(), 0.001) << condition.name;
  }
}

TEST(SegmentationStudy, GreyFindsWhatDiffersInTextureToo) {
  const std::vector<Figures> figures = MeasureDemo(false, Conditions()[0]);
  EXPECT_GE(figures[0].recall(), 0.999);
  EXPECT_LT(figures[0].false_share(), 0.001);
  EXPECT_GT(figures[0].recall(), figures[1].recall());
}

TEST(SegmentationStudy, ShadowsAreIgnoredWithoutLosingObstacles) {
  for (const bool colour : {false, true}) {
    const std::vector<Figures> figures = MeasureDemo(colour, Conditions()[0]);
    ASSERT_GT(figures[2].shadow_mask, 100);
    EXPECT_GT(figures[0].shadow_foreground, 0.9 * double(figures[0].shadow_mask));
    EXPECT_LT(figures[2].shadow_foreground, (colour ? 0.02 : 0.3) * double(figures[2].shadow_mask));
    EXPECT_GE(figures[2].recall(), figures[0].recall() - 0.001);
  }
}

}  // namespace
}  // namespace silhouette::segmentation_experiment
