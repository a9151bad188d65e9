// SPDX-License-Identifier: Apache-2.0
// What a comparison of captured and drawn masks finds. Captured ones are drawn here, from the true
// robot without tolerance.
#include "capture/verification/model_comparison.h"

#include <gmock/gmock.h>

#include <numbers>
#include <string>
#include <vector>

#include "calib/robot/drawn_cell.h"
#include "tests/calib/robot/drawing/random_robots.h"
#include "tests/random.h"

namespace silhouette {
namespace {

using Eigen::Vector3d;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

const std::vector<std::string> kViewNames = {"top", "left", "front", "corner"};

CameraModel ModelCameraAt(const Vector3d& centre, double turned) {
  const CameraIntrinsics in{
      .width = 64, .height = 64, .fx = 66, .fy = 66, .cx = 31.5, .cy = 31.5, .distortion = {}};
  const Vector3d along = (Vector3d(0, 0, 0.85) - centre).normalized();
  Eigen::Matrix3d world_from_camera;
  world_from_camera.col(2) = along;
  world_from_camera.col(0) = along.cross(Vector3d(0.01, 0.02, 1)).normalized();
  world_from_camera.col(1) = along.cross(world_from_camera.col(0));
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = world_from_camera * Eigen::AngleAxisd(turned, Vector3d::UnitY());
  pose.translation() = centre;
  return {in, pose.inverse()};
}

struct ModelComparisonTest : ::testing::Test {
  // `first_turned`: of the first camera, about its y axis.
  static std::vector<PartDrawer> Views(double first_turned = 0) {
    std::vector<PartDrawer> views;
    for (const Vector3d& at : {Vector3d(0, 0.1, 4.9), Vector3d(0, 4.3, 1.4), Vector3d(4.3, 0, 1.4),
                               Vector3d(2.4, -2.7, 3.6)}) {
      views.emplace_back(ModelCameraAt(at, views.empty() ? first_turned : 0), MaskSize{64, 64});
    }
    return views;
  }

  // As DrawnRobotOf() makes it.
  static DrawnRobot WithTolerance(const DrawnRobot& robot) {
    std::vector<RobotPart> parts = robot.parts();
    for (RobotPart& part : parts) part.radius += kTolerance;
    return {robot.chain(), std::move(parts), robot.views()};
  }

  // Captured masks of `truth`, at joint values that are off by `offset`.
  std::vector<ModelSample> Samples(const DrawnRobot& truth, const std::vector<double>& offset,
                                   int count = 30) {
    std::vector<ModelSample> samples;
    for (int i = 0; i < count; ++i) {
      const std::vector<double> q = RandomPositions(random, robot);
      std::vector<double> there = q;
      for (size_t j = 0; j < q.size(); ++j) there[j] += offset[j];
      samples.push_back({.q = q, .captured = truth.Touched(there)});
    }
    return samples;
  }

  ModelComparison Found(const std::vector<ModelSample>& samples) const {
    std::vector<GridJoint> joints;
    for (const RobotJoint& joint : robot.joints()) {
      joints.push_back({.name = joint.name, .lower = joint.lower, .upper = joint.upper});
    }
    return CompareModel(WithTolerance(Drawn(robot, Views())), joints, link_names, kViewNames,
                        samples, settings);
  }

  static std::vector<std::string> NamesOf(const RobotModel& model) {
    std::vector<std::string> names;
    for (const RobotLink& link : model.links()) names.push_back(link.name);
    return names;
  }
  size_t LinkOf(const std::string& name) const {
    return static_cast<size_t>(std::ranges::find(link_names, name) - link_names.begin());
  }
  // With a cable on the forearm, `off` its axis.
  RobotModel WithCable(double off) const {
    return robot.WithBody(LinkOf("forearm"),
                          {.shape = CylinderShape{.radius = 0.015, .length = 0.36},
                           .link_from_shape = Eigen::Isometry3d(Eigen::Translation3d(off, 0, 0.25)),
                           .colour = {}});
  }

  Random random;
  RobotModel robot = Rx130();
  std::vector<std::string> link_names = NamesOf(robot);
  std::vector<double> exact = std::vector<double>(6);
  ComparisonSettings settings;
};

TEST_F(ModelComparisonTest, RobotAsItsModelNeedsNoGrowth) {
  const ModelComparison found = Found(Samples(Drawn(robot, Views()), exact, 60));
  EXPECT_THAT(found.faults, IsEmpty());
  for (const ComparedLink& link : found.links) EXPECT_EQ(link.growth, 0);
  EXPECT_EQ(found.additional, 0);
  EXPECT_EQ(found.held_out_masks, 30u * 4);
  EXPECT_EQ(found.held_out_missing, 0u);
}

TEST_F(ModelComparisonTest, CableGrowsItsLinkUntilEveryCapturedPixelIsHeld) {
  const std::vector<ModelSample> samples = Samples(Drawn(WithCable(0.11), Views()), exact);
  const ModelComparison found = Found(samples);
  EXPECT_THAT(found.faults, IsEmpty());
  const double needed = 0.11 + 0.015 - 0.065 - kTolerance;
  EXPECT_GT(found.links[LinkOf("forearm")].growth, needed - 0.015);
  EXPECT_LT(found.links[LinkOf("forearm")].growth, needed + 0.015);
  for (const char* other : {"base", "shoulder", "upper_arm"}) {
    EXPECT_LT(found.links[LinkOf(other)].growth, 0.03) << other;
  }
  std::vector<RobotPart> parts = WithTolerance(Drawn(robot, Views())).parts();
  for (RobotPart& part : parts) part.radius += found.links[part.link].growth;
  const DrawnRobot grown(ChainOf(robot), parts, Views());
  for (const ModelSample& sample : samples) {
    const std::vector<Mask> masks = grown.Touched(sample.q);
    for (size_t view = 0; view < masks.size(); ++view) {
      EXPECT_TRUE((sample.captured[view] - masks[view]).Empty());
    }
  }
}

TEST_F(ModelComparisonTest, WhatIsFartherThanTheMostGrowthIsRefusedWithItsLink) {
  const ModelComparison found = Found(Samples(Drawn(WithCable(0.35), Views()), exact));
  EXPECT_THAT(found.faults, Contains(HasSubstr("view 'left'")));
  EXPECT_THAT(found.faults, Contains(HasSubstr("nearest to the link 'forearm'")));
}

TEST_F(ModelComparisonTest, CameraThatTurnedByADegreeIsRefusedWithItsView) {
  const ModelComparison found =
      Found(Samples(Drawn(robot, Views(std::numbers::pi / 180)), exact, 60));
  EXPECT_THAT(found.faults, Contains(HasSubstr("view 'top': captured masks are shifted")));
  for (const std::string& fault : found.faults) EXPECT_THAT(fault, HasSubstr("'top'"));
}

TEST_F(ModelComparisonTest, EdgesThatAllFallAlikeBetweenPixelsAreNoCameraThatMoved) {
  std::vector<ModelSample> samples = Samples(Drawn(robot, Views()), exact);
  for (ModelSample& sample : samples) {
    // Of each part that stands out at its top, the model draws one row more.
    const Mask mask = sample.captured[1];
    sample.captured[1] = Mask::FromPredicate(
        mask.size(), [&](int x, int y) { return y > 0 && mask.at(x, y) && mask.at(x, y - 1); });
  }
  const ModelComparison found = Found(samples);
  EXPECT_GT(found.views[1].mean_shift.y(), settings.most_shift);
  EXPECT_THAT(found.faults, IsEmpty());
}

TEST_F(ModelComparisonTest, SwappedViewsAreRefused) {
  std::vector<ModelSample> samples = Samples(Drawn(robot, Views()), exact);
  for (ModelSample& sample : samples) std::swap(sample.captured[1], sample.captured[2]);
  const ModelComparison found = Found(samples);
  EXPECT_THAT(found.faults, Contains(HasSubstr("'left'")));
  EXPECT_THAT(found.faults, Contains(HasSubstr("'front'")));
}

TEST_F(ModelComparisonTest, JointThatIsEightDegreesOffIsRefused) {
  for (size_t joint = 0; joint < 3; ++joint) {
    std::vector<double> off = exact;
    off[joint] = 8 * std::numbers::pi / 180;
    EXPECT_FALSE(Found(Samples(Drawn(robot, Views()), off)).faults.empty()) << "joint " << joint;
  }
}

TEST_F(ModelComparisonTest, BaseThatIsThreeCentimetresOffIsRefusedByTheShiftOfItsMasks) {
  std::vector<PartDrawer> views;
  for (const PartDrawer& view : Views()) {
    views.emplace_back(
        CameraModel(view.camera().intrinsics(),
                    view.camera().camera_from_world() * Eigen::Translation3d(0.03, 0, 0)),
        view.size());
  }
  EXPECT_THAT(Found(Samples(Drawn(robot, views), exact)).faults,
              Contains(HasSubstr("captured masks are shifted")));
}

TEST_F(ModelComparisonTest, LinkThatIsNotThereIsRefusedByItsName) {
  const DrawnRobot whole = Drawn(robot, Views());
  std::vector<RobotPart> parts = whole.parts();
  std::erase_if(parts, [&](const RobotPart& part) { return part.link == LinkOf("upper_arm"); });
  const ModelComparison found =
      Found(Samples(DrawnRobot(whole.chain(), parts, whole.views()), exact));
  EXPECT_THAT(found.faults, Contains(HasSubstr("link 'upper_arm'")));
}

TEST_F(ModelComparisonTest, FewSpecksFarAwayAreNoiseAndAreasAreNot) {
  const DrawnRobot truth = Drawn(robot, Views());
  std::vector<ModelSample> samples = Samples(truth, exact);
  const auto add = [&](ModelSample& sample, int side) {
    const Mask speck = Mask::FromPredicate(
        {64, 64}, [&](int x, int y) { return x < side && y < std::min(side, 2); });
    sample.captured[0] = sample.captured[0] | speck;
  };
  add(samples[3], 1);
  const ModelComparison specks = Found(samples);
  EXPECT_THAT(specks.faults, IsEmpty());
  EXPECT_EQ(specks.views[0].noise, 1u);
  add(samples[4], 3);
  const ModelComparison areas = Found(samples);
  EXPECT_EQ(areas.views[0].unreached, 6u);
  EXPECT_THAT(areas.faults, Contains(HasSubstr("view 'top': 6 captured pixels")));
  for (ModelSample& sample : samples) add(sample, 1);
  EXPECT_THAT(Found(samples).faults, Contains(HasSubstr("specks far from the robot")));
}

TEST_F(ModelComparisonTest, WhatStandsBeforeTheRobotIsNotTakenForAMissingLink) {
  const DrawnRobot truth = Drawn(robot, Views());
  std::vector<ModelSample> samples = Samples(truth, exact);
  const Mask table = Mask::FromPredicate({64, 64}, [](int, int y) { return y > 44; });
  for (ModelSample& sample : samples) sample.captured[1] = sample.captured[1] - table;
  const ModelComparison found = Found(samples);
  EXPECT_GT(found.views[1].hidden, 0u);
  EXPECT_EQ(found.views[1].uncaptured, 0u);
}

TEST_F(ModelComparisonTest, FewFrayedMasksOfARightModelVerifyItAndItsGrowthHoldsOthers) {
  // Camera pixels as coarse as mask pixels: a tenth of the pixels up to 15 mm about the robot.
  std::vector<RobotPart> parts = Drawn(robot, Views()).parts();
  for (RobotPart& part : parts) part.radius += 0.015;
  const DrawnRobot about(ChainOf(robot), parts, Views());
  const auto frayed = [&](int count) {
    std::vector<ModelSample> samples = Samples(Drawn(robot, Views()), exact, count);
    for (ModelSample& sample : samples) {
      const std::vector<Mask> most = about.Touched(sample.q);
      for (size_t view = 0; view < most.size(); ++view) {
        sample.captured[view] =
            sample.captured[view] | Mask::FromPredicate(most[view].size(), [&](int x, int y) {
              return most[view].at(x, y) && Uniform(random, 0, 1) < 0.1;
            });
      }
    }
    return samples;
  };
  const std::vector<ModelSample> others = frayed(100);
  for (int i = 0; i < SampleCount(4); ++i) {
    const ModelComparison found = Found(frayed(30));
    EXPECT_THAT(found.faults, IsEmpty());
    EXPECT_GT(found.further, 0);
    EXPECT_GT(found.enough, 30u);
    EXPECT_LE(found.further, kMostFurther);
    const DrawnRobot grown = *Grown(WithTolerance(Drawn(robot, Views())), found.LinkGrowth());
    int lacking = 0;
    for (const ModelSample& sample : others) {
      const std::vector<Mask> drawn = grown.Touched(sample.q);
      for (size_t view = 0; view < drawn.size(); ++view) {
        lacking += !(sample.captured[view] - drawn[view]).Empty();
      }
    }
    EXPECT_LE(lacking, settings.most_held_out * 4 * 100);
  }
}

TEST_F(ModelComparisonTest, WhatFewConfigurationsShowIsRefusedWithHowManyMayDo) {
  const DrawnRobot swung = Drawn(WithCable(0.14), Views());
  std::vector<ModelSample> samples = Samples(Drawn(robot, Views()), exact);
  for (const size_t i : {3, 17}) samples[i].captured = swung.Touched(samples[i].q);
  const ModelComparison found = Found(samples);
  EXPECT_EQ(found.further, 0);
  EXPECT_GE(found.enough, 2 * samples.size());
  EXPECT_THAT(found.faults, Contains(HasSubstr("30 configurations are too few, " +
                                               std::to_string(found.enough) + " may do")));
}

TEST_F(ModelComparisonTest, JointThatNeverMovedIsNotVerified) {
  std::vector<ModelSample> samples = Samples(Drawn(robot, Views()), exact);
  for (ModelSample& sample : samples) {
    sample.q[3] = 0;
    sample.captured = Drawn(robot, Views()).Touched(sample.q);
  }
  EXPECT_THAT(Found(samples).faults,
              ElementsAre(HasSubstr("joint 'joint_4' moved through only 0.0 deg of 360.0 deg")));
  settings.least_moved = 0;
  EXPECT_THAT(Found(samples).faults, IsEmpty());
}

TEST_F(ModelComparisonTest, ReversedAxisOfABarIsNotVerifiedByItsQuarterTurns) {
  const auto bar = [](const Vector3d& axis, double radius) {
    const Eigen::Isometry3d at(Eigen::Translation3d(0, 0, 0.85));
    return DrawnRobot(
        KinematicChain(
            {{.name = "turn", .lower = -std::numbers::pi, .upper = std::numbers::pi}},
            {ChainLink{}, {.parent = 0, .joint = 0, .parent_from_link = at, .axis = axis}}),
        {{.link = 1,
          .moves_with = 1,
          .points = (Eigen::Matrix3Xd(3, 2) << -0.4, 0.4, 0, 0, 0, 0).finished(),
          .radius = radius,
          .inner = {}}},
        Views());
  };
  const DrawnRobot truth = bar(-Vector3d::UnitZ(), 0.05);
  std::vector<ModelSample> samples;
  const auto add = [&](double turn) {
    samples.push_back({.q = {turn}, .captured = truth.Touched(std::vector<double>{turn})});
  };
  const auto faults = [&] {
    return CompareModel(
               bar(Vector3d::UnitZ(), 0.05 + kTolerance),
               std::vector<GridJoint>{
                   {.name = "turn", .lower = -std::numbers::pi, .upper = std::numbers::pi}},
               std::vector<std::string>{"base", "bar"}, kViewNames, samples, settings)
        .faults;
  };
  for (int i = 0; i < 32; ++i) add((i % 4 - 2) * std::numbers::pi / 2);
  EXPECT_THAT(faults(),
              ElementsAre(AllOf(HasSubstr("joint 'turn'"), HasSubstr("its axis may be reversed"))));
  add(std::numbers::pi / 6);
  EXPECT_THAT(faults(), Contains(HasSubstr("farther than most_growth"))) << "it is reversed";
}

TEST_F(ModelComparisonTest, TooFewConfigurationsAreRefused) {
  EXPECT_THAT(Found(Samples(Drawn(robot, Views()), exact, 29)).faults,
              Contains(HasSubstr("29 configurations are too few")));
}

}  // namespace
}  // namespace silhouette
