// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/cell/trial.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "tests/tools/silhouette-experiments/cell/small_workplace.h"
#include "tools/silhouette-experiments/cell/explanation.h"
#include "tools/silhouette-experiments/cell/leave.h"

namespace silhouette::cell_experiment {
namespace {

RandomScene SceneWith(const SmallWorkplace& small, std::vector<Obstacle> obstacles) {
  RandomScene scene;
  scene.obstacles = std::move(obstacles);
  scene.robot = small.served().grid().At(0);
  scene.robot_on_grid = true;
  return scene;
}

TEST(CellTrial, OccupiedIsWhatTouchesExactly) {
  const SmallWorkplace small;
  const TrialSetting setting = small.Setting();
  const auto viewed = View(setting, SceneWith(small, {WhiteBox({0.3, 0.3, 1}, {0.5, 0, 0.9})}), 0);
  ASSERT_TRUE(viewed.ok()) << viewed.status();
  const TrialResult result = Judge(setting, *viewed, 0);
  ASSERT_EQ(result.blocked, Reason::kNone);

  const ContactChecker contact(small.workplace().robot(), viewed->truth.obstacles);
  const Poses obstacles = ObstaclePoses(viewed->truth.obstacles, 0);
  uint64_t touching = 0;
  for (ConfigurationNumber i = 0; i < small.served().grid().number_limit(); ++i) {
    if (!small.served().grid().Contains(i)) continue;
    const Poses links = small.workplace().LinkPoses(small.served().grid().At(i));
    touching += contact.Check(links, obstacles).touching ? 1 : 0;
  }
  ASSERT_GT(touching, 0u);
  for (const auto& tally : result.tallies) {
    EXPECT_EQ(tally[kOnGrid].tested, small.served().grid().size());
    EXPECT_EQ(tally[kOnGrid].occupied, touching);
    EXPECT_EQ(tally[kOffGrid].tested, 50u);
  }
}

TEST(CellTrial, LeavingEndsWithItsFirstSceneWhenAStopIsAskedFor) {
  const SmallWorkplace small;
  int asked = 0;
  const auto stopped = RunLeave(small.Setting(), 3, [&](int) { return ++asked < 2; });
  EXPECT_TRUE(absl::IsCancelled(stopped.status())) << stopped.status();
  EXPECT_EQ(asked, 2);
}

TEST(CellTrial, NearThingsAreAsFarFromTheRobotAsTheyShouldBeAndInItsWay) {
  const SmallWorkplace small;
  const SimulatedWorkplace& workplace = small.workplace();
  for (const NearThing& thing : NearThings()) {
    const auto scene = MakeNearScene(workplace, thing, 1, 0);
    ASSERT_TRUE(scene.has_value()) << NameOf(thing);
    const ContactChecker contact(workplace.robot(), scene->obstacles);
    const Poses obstacles = ObstaclePoses(scene->obstacles, 0);
    const double distance = contact.Check(workplace.LinkPoses(scene->robot), obstacles).distance;
    EXPECT_GE(distance, thing.least_distance) << NameOf(thing);
    EXPECT_LE(distance, thing.largest_distance) << NameOf(thing);
    const TriangleMesh& mesh = scene->obstacles[0].mesh;
    double least = std::numeric_limits<double>::infinity();
    for (const Eigen::Vector3d& vertex : mesh.vertices) least = std::min(least, vertex.norm());
    EXPECT_LE(least, thing.largest_radius * 1.001) << NameOf(thing);
    bool touches = false;
    for (ConfigurationNumber i = 0; i < small.served().grid().number_limit() && !touches; ++i) {
      if (!small.served().grid().Contains(i)) continue;
      touches = contact.Touches(workplace.LinkPoses(small.served().grid().At(i)), obstacles);
    }
    EXPECT_TRUE(touches) << NameOf(thing);
  }
}

TEST(CellTrial, WhatIsPlainlyVisibleIsNotMissingForItsContrast) {
  const SmallWorkplace small;
  const TrialSetting setting = small.Setting();
  const auto viewed = View(setting, SceneWith(small, {WhiteBox({0.3, 0.3, 1}, {0.5, 0, 0.9})}), 0);
  ASSERT_TRUE(viewed.ok()) << viewed.status();
  const TrialResult result = Judge(setting, *viewed, 0);
  const Tally& calibrated = result.tallies[1][kOnGrid];
  EXPECT_GT(calibrated.occupied, 2 * calibrated.missing);
  Explainer explainer(setting);
  for (const MissedConfiguration& missed : result.missed) {
    for (const Explanation& explanation : explainer.Explain(*viewed, missed)) {
      EXPECT_NE(explanation.cause, Cause::kContrast) << explanation.sentence;
      EXPECT_NE(explanation.cause, Cause::kUnexplained) << explanation.sentence;
    }
  }
}

TEST(CellTrial, EmptyCellHasNothingOccupiedMissingOrExplained) {
  const SmallWorkplace small;
  const TrialSetting setting = small.Setting();
  Explainer explainer(setting);
  const auto record = RunScene(
      setting, explainer, [&](int) { return SceneWith(small, {}); }, 0);
  ASSERT_TRUE(record.ok()) << record.status();
  for (const auto& tally : record->tallies) {
    for (const Tally& each : tally) EXPECT_EQ(each.occupied + each.missing, 0u);
  }
  EXPECT_TRUE(record->missing.empty());
}

TEST(CellTrial, ObstacleThatLooksLikeTheCellIsMissingForItsContrast) {
  const SmallWorkplace small;
  const TrialSetting setting = small.Setting();
  const RandomScene white = SceneWith(small, {WhiteBox({0.3, 0.3, 1}, {0.5, 0, 0.9})});
  // The images are of the cell without it, the truth has it: nobody sees the obstacle.
  auto empty = View(setting, SceneWith(small, {}), 0);
  ASSERT_TRUE(empty.ok()) << empty.status();
  const ViewedScene invisible{white, empty->images, empty->scene};
  const TrialResult result = Judge(setting, invisible, 0);
  ASSERT_FALSE(result.missed.empty());
  Explainer explainer(setting);
  int contrast = 0;
  for (const MissedConfiguration& missed : result.missed) {
    for (const Explanation& explanation : explainer.Explain(invisible, missed)) {
      EXPECT_FALSE(explanation.sentence.empty());
      contrast += explanation.cause == Cause::kContrast ? 1 : 0;
    }
  }
  EXPECT_GT(contrast, 0);
}

// A drawn robot that leaves the stated workspace, and one that the cell file forbids to be
// somewhere.
TEST(CellTrial, ADrawnRobotGetsTheServersVerdictsInForbiddenRegionsAndOutsideTheWorkspace) {
  ProgramCell files;
  files.WriteCell(
      {{"capture:\n",
        "workspace: {lower: [-0.4, -2, -0.5], upper: [2, 2, 2.5]}\n"
        "sound: {least_obstacle: 0.5}\n"
        "capture:\n"
        "  forbidden_regions: [{name: folded, joints: {joint_3: [60 deg, 110 deg]}}]\n"}});
  const auto workplace = SimulatedWorkplace::Load(files.cell());
  ASSERT_TRUE(workplace.ok()) << workplace.status();
  const auto database = workplace->OpenUncaptured(files.database());
  ASSERT_TRUE(database.ok()) << database.status();
  ServeSettings serve;
  serve.drawn = PartSettings();
  const auto served = workplace->Serve(**database, serve);
  ASSERT_TRUE(served.ok()) << served.status();
  const TrialSetting setting{
      .workplace = *workplace,
      .database = **served,
      .policies = {{.preset = Preset::kUncalibrated}, {.preset = Preset::kSound}},
      .off_grid_tests = 0,
      .seed = 1};
  RandomScene scene;
  scene.robot = {0, 0};
  auto viewed = View(setting, std::move(scene), 0);
  ASSERT_TRUE(viewed.ok()) << viewed.status();
  // Nothing is in the cell but the robot, whose shadow no drawn image has.
  for (auto& image : viewed->scene.obstacle_images) {
    image = ObstacleImage::FromScene(Mask(image->size()), Mask(image->size()));
  }
  const auto checkers = CheckersOf(setting, *viewed);
  int outside = 0;
  const ConfigurationGrid& grid = (*served)->grid();
  for (ConfigurationNumber number = 0; number < grid.number_limit(); ++number) {
    if (!grid.Contains(number)) continue;
    const Configuration q = grid.At(number);
    SCOPED_TRACE(testing::PrintToString(q));
    const bool forbidden = q[1] > 1.1;
    const Reason sound = checkers[1]->Check(q).reason();
    EXPECT_EQ(checkers[0]->Check(q).reason(), forbidden ? Reason::kExcluded : Reason::kNone);
    EXPECT_EQ(sound == Reason::kExcluded, forbidden);
    outside += sound == Reason::kOutsideWorkspace ? 1 : 0;
  }
  EXPECT_GT(outside, 0);
}

TEST(CellTrial, UncalibratedIsTestedWithTheServersThresholdOfTheCell) {
  const SmallWorkplace small;
  const auto policies = [&](const Policy& of_cell) {
    return PoliciesFor({"uncalibrated", "paper", "calibrated"}, {}, of_cell, small.served())
        .value();
  };
  const auto usual = policies({});
  ASSERT_EQ(usual.size(), 4u);
  EXPECT_EQ(usual[0].min_views, 1) << "of two views";
  EXPECT_EQ(usual[1].min_views, 2) << "paper";
  EXPECT_EQ(usual[2].min_views, 1);
  EXPECT_EQ(usual[3].min_views, 2);
  const auto strict = policies({.max_occluded_views = 0});
  ASSERT_EQ(strict.size(), 3u);
  for (const Policy& policy : strict) {
    EXPECT_EQ(policy.min_views, 2);
    EXPECT_EQ(policy.max_occluded_views, 0);
  }
}

TEST(CellTrial, SameSeedGivesTheSameScene) {
  const SmallWorkplace small;
  const Eigen::AlignedBox3d box = SweptBox(small.workplace());
  for (int number = 0; number < 6; ++number) {
    const RandomScene a = MakeRandomScene(small.workplace(), box, 5, number);
    const RandomScene b = MakeRandomScene(small.workplace(), box, 5, number);
    const RandomScene other = MakeRandomScene(small.workplace(), box, 6, number);
    EXPECT_EQ(a.robot, b.robot);
    EXPECT_EQ(a.obstacles.size(), b.obstacles.size());
    EXPECT_NE(a.time, other.time);
    EXPECT_GE(a.obstacles.size(), 1u);
    EXPECT_LE(a.obstacles.size(), 5u);
    const ContactChecker contact(small.workplace().robot(), a.obstacles);
    EXPECT_FALSE(
        contact.Touches(small.workplace().LinkPoses(a.robot), ObstaclePoses(a.obstacles, 0)))
        << "the robot stands free";
  }
}

}  // namespace
}  // namespace silhouette::cell_experiment
