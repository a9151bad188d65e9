// SPDX-License-Identifier: Apache-2.0
// The bars of the segmentation, in a few scenes of the demo's cell.
#include "tools/silhouette-experiments/segmentation/study.h"

#include <gtest/gtest.h>

#include <fstream>

#include "tests/folders.h"
#include "tests/test_folder.h"

namespace silhouette::segmentation_experiment {
namespace {

// Two views of the demo's cell, and one joint that moves.
cell_experiment::SimulatedWorkplace Demo() {
  const std::string sim = SourceFolder() + "/capture/sim/";
  const std::string file = TestFolder() / "cell.yaml";
  std::ofstream(file) << "name: demo\nsimulation: " << sim << "cells/demo/simulation.yaml\n"
                      << "robot:\n  driver: sim\n  urdf: " << sim << "robots/rx130.urdf\n"
                      << "  joints: [{name: joint_1, lower: -2.6, upper: 2.6}]\n"
                      << "  fixed: {joint_2: 0, joint_3: 0, joint_4: 0, joint_5: 0, joint_6: 0}\n"
                      << "grid: {steps: {joint_1: 53}}\n"
                      << "views:\n";
  for (const char* view : {"top", "top_right"}) {
    std::ofstream(file, std::ios::app)
        << "  - {name: " << view << ", source: sim, image_size: [320, 240], mask_size: [64, 64]}\n";
  }
  return cell_experiment::SimulatedWorkplace::Load(file).value();
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
