// SPDX-License-Identifier: Apache-2.0
// That a robot that is driven to samples stays clear of itself, the workspace's faces and forbidden
// regions, all along its way.
#include "capture/verification/sampler.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "capture/verification/samples.h"
#include "tests/calib/robot/drawing/random_robots.h"
#include "tests/random.h"

namespace silhouette {
namespace {

using Eigen::Vector3d;

struct SamplerTest : ::testing::Test {
  Configuration Upright() const { return Configuration(6, 0.0); }

  // Whether the corners of all parts are within the workspace.
  bool IsInside(const Configuration& q) const {
    std::vector<Eigen::Isometry3d> poses;
    robot.chain().Pose(q, poses);
    for (const RobotPart& part : robot.parts()) {
      if (part.link < 2) continue;  // base and shoulder only turn where they stand
      for (Eigen::Index i = 0; i < part.points.cols(); ++i) {
        const Vector3d at = poses[part.moves_with] * part.points.col(i);
        if (workspace.exteriorDistance(at) > 0) return false;
      }
    }
    return true;
  }

  // Those of the model, but for the fourth joint.
  static std::vector<GridJoint> RangesOf(const DrawnRobot& robot) {
    std::vector<GridJoint> joints;
    for (const ChainJoint& joint : robot.chain().joints()) {
      joints.push_back({.name = joint.name, .lower = joint.lower, .upper = joint.upper});
    }
    joints[3].lower = -1;
    joints[3].upper = 2;
    return joints;
  }

  DrawnRobot robot = Drawn(Rx130(), {});
  std::vector<GridJoint> joints = RangesOf(robot);
  Eigen::AlignedBox3d workspace{Vector3d(-1.8, -1.8, 0), Vector3d(1.8, 1.8, 2.3)};
  ModelSampler sampler{robot, joints, workspace, {}, {}, 1};
};

TEST_F(SamplerTest, WaysStayInTheWorkspaceAndReachAllRanges) {
  Configuration here = Upright();
  ASSERT_TRUE(sampler.IsClear(here));
  std::vector<Configuration> places;
  for (int i = 0; i < 60; ++i) {
    const auto next = sampler.Next(here);
    ASSERT_TRUE(next.has_value()) << i;
    for (int k = 0; k <= 50; ++k) {
      Configuration q = here;
      for (size_t j = 0; j < 6; ++j) q[j] += k / 50.0 * ((*next)[j] - here[j]);
      EXPECT_TRUE(IsInside(q));
    }
    here = *next;
    places.push_back(here);
  }
  for (size_t j = 0; j < 6; ++j) {
    const GridJoint& joint = joints[j];
    double lowest = joint.upper;
    double highest = joint.lower;
    for (const Configuration& q : places) {
      lowest = std::min(lowest, q[j]);
      highest = std::max(highest, q[j]);
      EXPECT_GE(q[j], joint.lower);
      EXPECT_LE(q[j], joint.upper);
    }
    EXPECT_GT(highest - lowest, 0.4 * (joint.upper - joint.lower)) << joint.name;
  }
}

TEST_F(SamplerTest, LinksThatKeepJustTheClearanceDoNotStopTheRobot) {
  // 3 cm from the wrist to the tool, with half a centimetre more on each.
  std::vector<RobotPart> parts = robot.parts();
  for (RobotPart& part : parts) part.radius += 0.005;
  const DrawnRobot grown(robot.chain(), parts, {});
  ModelSampler of_grown(grown, joints, workspace, {}, {}, 1);
  EXPECT_TRUE(of_grown.Next(Upright()).has_value());
}

TEST_F(SamplerTest, RobotThatMeetsItselfOrTheFloorIsNotClear) {
  EXPECT_FALSE(sampler.IsClear(Configuration{0, 2.3, 0, 0, 0, 0})) << "in the floor";
  EXPECT_FALSE(sampler.IsClear(Configuration{0, -0.6, 2.48, 0, 1.2, 0})) << "the tool in the arm";
  EXPECT_FALSE(sampler.IsClearWay(Configuration{0, 1.2, 1.0, 0, 0, 0},
                                  Configuration{0, -1.2, -1.0, 0, 3.5, 0}));
}

// Whatever is between two looks.
TEST_F(SamplerTest, GapsKeepHalfOfWhatTheyKeepAllAlongTheWay) {
  Configuration here = Upright();
  for (int i = 0; i < 10; ++i) {
    const Configuration next = sampler.Next(here).value();
    for (int k = 0; k <= 3000; ++k) {
      Configuration q = here;
      for (size_t j = 0; j < 6; ++j) q[j] += k / 3000.0 * (next[j] - here[j]);
      for (const NarrowGap& gap : sampler.NarrowGapsAt(q)) ASSERT_GE(gap.width, gap.kept / 2);
    }
    here = next;
  }
}

TEST_F(SamplerTest, RobotThatStandsNearAFaceLeavesAndComesNoNearer) {
  Configuration here = {0, 1.2, 0, 0, 0, 0};
  const auto lowest = [&](const Configuration& q) {
    const std::vector<NarrowGap> narrow = sampler.NarrowGapsAt(q);
    return narrow.empty() ? 0.08 : narrow.front().width;
  };
  while (lowest(here) > 0.02) here[1] += 0.001;
  ASSERT_GE(lowest(here), kLeastKept);
  for (int i = 0; i < 5; ++i) {
    const auto next = sampler.Next(here);
    ASSERT_TRUE(next.has_value());
    EXPECT_TRUE(sampler.IsClear(*next));
    for (int k = 0; k <= 500; ++k) {
      Configuration q = here;
      for (size_t j = 0; j < 6; ++j) q[j] += k / 500.0 * ((*next)[j] - here[j]);
      EXPECT_GE(lowest(q), lowest(here) / 2) << k;
    }
  }
  while (lowest(here) > kLeastKept) here[1] += 0.001;
  EXPECT_FALSE(sampler.Next(here).has_value()) << "it may touch the floor";
}

// A robot of a text, driven in all of its joints' ranges.
struct SmallRobot {
  explicit SmallRobot(const std::string& links_and_joints, SamplerSettings settings = {})
      : robot(Drawn(
            RobotModel::FromUrdf(WriteFile(FreshFolder() / "small.urdf",
                                           "<robot name='small'>" + links_and_joints + "</robot>"))
                .value(),
            {})) {
    for (const ChainJoint& joint : robot.chain().joints()) {
      joints.push_back({.name = joint.name,
                        .lower = joint.lower,
                        .upper = joint.upper,
                        .continuous = joint.continuous});
    }
    settings.tolerance = kTolerance;
    // As cells are drawn.
    std::vector<RobotPart> parts = robot.parts();
    for (RobotPart& part : parts) part.radius += kTolerance;
    robot = DrawnRobot(robot.chain(), parts, {});
    sampler.emplace(robot, joints, Eigen::AlignedBox3d(Vector3d(-3, -3, -3), Vector3d(3, 3, 3)),
                    JointRegions(), settings, 1);
  }

  // Reaches configurations, one from the other.
  void ExpectGoes(Configuration here) {
    for (int i = 0; i < 50; ++i) {
      const auto next = sampler->Next(here);
      if (!next) {
        ADD_FAILURE() << "stays at " << i;
        for (const NarrowGap& gap : sampler->NarrowGapsAt(here)) {
          ADD_FAILURE() << gap.link << " and " << gap.other << ", face " << gap.face << ": "
                        << gap.width << " of " << gap.kept;
        }
        return;
      }
      here = *next;
    }
  }

  DrawnRobot robot;
  std::vector<GridJoint> joints;
  std::optional<ModelSampler> sampler;
};

std::string Body(const std::string& shape, const std::string& at = "0 0 0",
                 const std::string& turned = "0 0 0") {
  return "<visual><origin xyz='" + at + "' rpy='" + turned + "'/><geometry><" + shape +
         "/></geometry></visual>";
}

std::string Link(const std::string& name, const std::string& bodies) {
  return "<link name='" + name + "'>" + bodies + "</link>";
}

std::string Joint(const std::string& name, const std::string& type, const std::string& parent,
                  const std::string& child, const std::string& at, const std::string& axis,
                  double lower, double upper) {
  return "<joint name='" + name + "' type='" + type + "'><parent link='" + parent +
         "'/><child link='" + child + "'/><origin " + at + "/><axis xyz='" + axis +
         "'/><limit lower='" + std::to_string(lower) + "' upper='" + std::to_string(upper) +
         "'/></joint>";
}

// A drum that turns 12 mm from a guard, with a peg that hits the guard at a twentieth of a turn.
std::string Drum() {
  return Link("base", Body("box size='0.1 0.1 0.1'", "0 0 -0.3")) +
         Link("drum", Body("cylinder radius='0.1' length='0.2'") +
                          Body("box size='0.03 0.004 0.1'", "0.11 0 0")) +
         Link("guard", Body("box size='0.02 0.01 0.2'", "0.1223 0 0")) +
         Joint("spin", "revolute", "base", "drum", "xyz='0 0 0'", "0 0 1", -3.1, 3.1) +
         Joint("travel", "prismatic", "base", "guard", "xyz='0 0 0'", "0 0 1", -0.005, 0.005);
}

TEST(Sampler, LinksThatAreNearNearlyEverywhereNeverTouchWhereTheyCould) {
  SmallRobot drum(Drum());
  int clear = 0;
  for (int i = 0; i < 100; ++i) clear += drum.sampler->IsClear(Configuration{-3 + 0.06 * i, 0});
  ASSERT_GE(clear, 90);
  EXPECT_FALSE(drum.sampler->IsClear(Configuration{0, 0})) << "the peg is in the guard";
  EXPECT_FALSE(drum.sampler->IsClearWay(Configuration{1, 0}, Configuration{-1, 0}));
  Configuration here = {1, 0};
  for (int i = 0; i < 200; ++i) {
    here = drum.sampler->Next(here).value();
    ASSERT_GT(here[0], 0.06) << "the peg passed the guard";
  }
}

TEST(Sampler, RobotWhoseLinksMayTouchStays) {
  SmallRobot drum(Drum());
  EXPECT_FALSE(drum.sampler->Next(Configuration{0, 0}).has_value());
  const std::vector<NarrowGap> narrow = drum.sampler->NarrowGapsAt(Configuration{0, 0});
  ASSERT_EQ(narrow.size(), 1u);
  EXPECT_EQ(narrow[0].link, 2u);
  EXPECT_EQ(narrow[0].other, 1u);
  EXPECT_LT(narrow[0].width, kLeastKept);
}

TEST(Sampler, LinksThatTheOperatorNamesAreNotChecked) {
  SmallRobot drum(Drum(), {.not_checked = {{1, 2}}});
  EXPECT_TRUE(drum.sampler->IsClear(Configuration{0, 0}));
  EXPECT_TRUE(drum.sampler->Next(Configuration{0, 0}).has_value());
}

TEST(Sampler, LinksThatTouchByTheirConstructionAreFoundAndOthersAreNot) {
  // The axis goes up and down through the bridge; the peg meets the guard only here and there.
  const std::string gantry =
      Link("frame", Body("box size='2.4 0.08 0.1'", "0 0.8 2")) +
      Link("bridge", Body("box size='0.1 1.8 0.1'")) +
      Link("trolley", Body("box size='0.2 0.2 0.04'")) +
      Link("axis", Body("box size='0.06 0.06 2'")) +
      Joint("x", "prismatic", "frame", "bridge", "xyz='0 0 0.5'", "1 0 0", -1, 1) +
      Joint("y", "prismatic", "bridge", "trolley", "xyz='0 0 0'", "0 1 0", -0.5, 0.5) +
      Joint("z", "prismatic", "trolley", "axis", "xyz='0 0 0'", "0 0 -1", 0, 0.7);
  const SmallRobot found(gantry);
  ASSERT_EQ(found.sampler->AlwaysNarrow().size(), 1u);
  EXPECT_EQ(found.sampler->AlwaysNarrow()[0].link, 3u);
  EXPECT_EQ(found.sampler->AlwaysNarrow()[0].other, 1u);
  const std::vector<std::string> names = {"frame", "bridge", "trolley", "z axis"};
  const std::string text = AlwaysNarrowText(*found.sampler, names);
  EXPECT_NE(text.find("'z axis' and 'bridge'; mend the model"), std::string::npos) << text;
  EXPECT_NE(text.find("--not-checked 'z axis' 'bridge'"), std::string::npos) << text;

  SmallRobot named(gantry, {.not_checked = {{1, 3}}});
  EXPECT_TRUE(named.sampler->AlwaysNarrow().empty());
  EXPECT_EQ(AlwaysNarrowText(*named.sampler, names), "");
  named.ExpectGoes(Configuration{0, 0, 0});
  EXPECT_TRUE(SmallRobot(Drum()).sampler->AlwaysNarrow().empty());
}

// Both are a millimetre thick: looks that are centimetres apart do not see them.
TEST(Sampler, ThinPartsDoNotPassThroughEachOther) {
  SmallRobot blade(Link("post", Body("box size='0.001 0.001 0.1'", "0.99 0 0")) +
                   Link("stand", Body("sphere radius='0.01'")) +
                   Link("blade", Body("box size='1 0.001 0.05'", "0.5 0 0")) +
                   Joint("slide", "prismatic", "post", "stand", "xyz='0 0 0'", "0 0 1", 0, 0.001) +
                   Joint("turn", "revolute", "stand", "blade", "xyz='0 0 0'", "0 0 1", -0.02, 3));
  EXPECT_TRUE(blade.sampler->IsClearWay(Configuration{0, 2.9}, Configuration{0, 0.05}));
  EXPECT_FALSE(blade.sampler->IsClearWay(Configuration{0, 2.9}, Configuration{0, -0.02}));
}

// wrist_2 is always 12 mm from the forearm: 2 mm with the tolerance of both.
TEST(Sampler, ArmLikeAUr5StartsAtZero) {
  constexpr double kTurn = 2 * std::numbers::pi;
  const std::string lies = "1.5708 0 0";
  SmallRobot arm(
      Link("base", Body("cylinder radius='0.06' length='0.02'", "0 0 0.01")) +
      Link("shoulder", Body("cylinder radius='0.06' length='0.14'")) +
      Link("upper_arm", Body("cylinder radius='0.06' length='0.11'", "0 0 0", lies) +
                            Body("cylinder radius='0.05' length='0.425'", "0 0 0.2125")) +
      Link("forearm", Body("cylinder radius='0.05' length='0.12'", "0 0 0", lies) +
                          Body("cylinder radius='0.04' length='0.392'", "0 0 0.196")) +
      Link("wrist_1", Body("cylinder radius='0.04' length='0.12'", "0 0.05 0", lies)) +
      Link("wrist_2", Body("cylinder radius='0.041' length='0.11'", "0 0 0.05")) +
      Link("wrist_3", Body("cylinder radius='0.035' length='0.04'", "0 0.06 0", lies)) +
      Link("ee", Body("box size='0.01 0.01 0.01'")) +
      Joint("pan", "revolute", "base", "shoulder", "xyz='0 0 0.0892'", "0 0 1", -kTurn, kTurn) +
      Joint("lift", "revolute", "shoulder", "upper_arm", "xyz='0 0.1359 0' rpy='0 1.5708 0'",
            "0 1 0", -kTurn, kTurn) +
      Joint("elbow", "revolute", "upper_arm", "forearm", "xyz='0 -0.1197 0.425'", "0 1 0", -kTurn,
            kTurn) +
      Joint("w1", "revolute", "forearm", "wrist_1", "xyz='0 0 0.3922' rpy='0 1.5708 0'", "0 1 0",
            -kTurn, kTurn) +
      Joint("w2", "revolute", "wrist_1", "wrist_2", "xyz='0 0.093 0'", "0 0 1", -kTurn, kTurn) +
      Joint("w3", "revolute", "wrist_2", "wrist_3", "xyz='0 0 0.0947'", "0 1 0", -kTurn, kTurn) +
      Joint("flange", "fixed", "wrist_3", "ee", "xyz='0 0.0823 0'", "0 0 1", 0, 0));
  arm.ExpectGoes(Configuration(6, 0.0));
}

// Seven axes, folded in on themselves; link 7 is 7 mm from link 5 where the arm starts.
TEST(Sampler, ArmLikeAPandaStartsAtZero) {
  const std::string stands = "xyz='0 0 0' rpy='-1.5708 0 0'";
  SmallRobot arm(
      Link("link0", Body("box size='0.2 0.2 0.14'", "0 0 0.07")) +
      Link("link1", Body("cylinder radius='0.06' length='0.2'", "0 0 -0.05")) +
      Link("link2", Body("cylinder radius='0.06' length='0.2'", "0 -0.15 0", "1.5708 0 0")) +
      Link("link3", Body("box size='0.14 0.1 0.1'", "0.04 0 0")) +
      Link("link4", Body("cylinder radius='0.05' length='0.12'")) +
      Link("link5", Body("cylinder radius='0.045' length='0.2'", "0 0 -0.12")) +
      Link("link6", Body("sphere radius='0.05'")) +
      Link("link7", Body("cylinder radius='0.035' length='0.06'", "0 0 0.07")) +
      Link("hand", Body("box size='0.05 0.2 0.06'", "0 0 0.04")) +
      Joint("j1", "revolute", "link0", "link1", "xyz='0 0 0.333'", "0 0 1", -2.9, 2.9) +
      Joint("j2", "revolute", "link1", "link2", stands, "0 0 1", -1.76, 1.76) +
      Joint("j3", "revolute", "link2", "link3", "xyz='0 -0.316 0' rpy='1.5708 0 0'", "0 0 1", -2.9,
            2.9) +
      Joint("j4", "revolute", "link3", "link4", "xyz='0.0825 0 0' rpy='1.5708 0 0'", "0 0 1", -3.07,
            -0.07) +
      Joint("j5", "revolute", "link4", "link5", "xyz='-0.0825 0.384 0' rpy='-1.5708 0 0'", "0 0 1",
            -2.9, 2.9) +
      Joint("j6", "revolute", "link5", "link6", "xyz='0 0 0' rpy='1.5708 0 0'", "0 0 1", -0.02,
            3.75) +
      Joint("j7", "revolute", "link6", "link7", "xyz='0.088 0 0' rpy='1.5708 0 0'", "0 0 1", -2.9,
            2.9) +
      Joint("flange", "fixed", "link7", "hand", "xyz='0 0 0.107'", "0 0 1", 0, 0));
  arm.ExpectGoes(Configuration{0, 0, 0, -0.07, 0, 0, 0});
}

// The axis that goes up and down is always 12 mm from the bridge, which is always 3 cm below the
// workspace's upper face.
TEST(Sampler, GantryStarts) {
  SmallRobot gantry(
      Link("frame", Body("box size='2.4 0.08 0.1'", "0 0.8 2.7") +
                        Body("box size='2.4 0.08 0.1'", "0 -0.8 2.7")) +
      Link("bridge", Body("box size='0.1 1.8 0.1'", "0 0 0.16")) +
      Link("trolley", Body("box size='0.2 0.2 0.04'", "0.1 0 0.03")) +
      Link("axis", Body("cylinder radius='0.04' length='0.8'", "0.1023 0 -0.15")) +
      Joint("x", "prismatic", "frame", "bridge", "xyz='0 0 2.76'", "1 0 0", -1, 1) +
      Joint("y", "prismatic", "bridge", "trolley", "xyz='0 0 0'", "0 1 0", -0.5, 0.5) +
      Joint("z", "prismatic", "trolley", "axis", "xyz='0 0 -0.1'", "0 0 -1", 0, 0.7));
  gantry.ExpectGoes(Configuration{0, 0, 0});
}

TEST_F(SamplerTest, WaysCrossNoForbiddenRegionAnywhere) {
  // The first joint turns without end; the second region is at the end of its turn.
  const JointRegions forbidden(
      {{{.joint = 1, .lower = 0.2, .upper = 0.25}, {.joint = 2, .lower = -0.5, .upper = 0.5}},
       {{.joint = 0, .continuous = true, .lower = 3, .upper = 3.5}}});
  joints[0] = {.name = joints[0].name,
               .lower = -std::numbers::pi,
               .upper = std::numbers::pi,
               .continuous = true};
  ModelSampler guarded(robot, joints, workspace, forbidden, {}, 1);
  Configuration here = Upright();
  for (int i = 0; i < 40; ++i) {
    const Configuration next = guarded.Next(here).value();
    EXPECT_LT(std::abs(next[0] - here[0]), std::numbers::pi) << "the shorter way is another";
    for (int k = 0; k <= 2000; ++k) {
      Configuration q = here;
      for (size_t j = 0; j < 6; ++j) q[j] += k / 2000.0 * (next[j] - here[j]);
      const bool in_first = q[1] >= 0.2 && q[1] <= 0.25 && std::abs(q[2]) <= 0.5;
      ASSERT_FALSE(in_first || q[0] >= 3 || q[0] <= 3.5 - 2 * std::numbers::pi);
    }
    here = next;
  }
}

TEST_F(SamplerTest, ForbiddenWaysAreNotTaken) {
  const JointRegions forbidden({{{.joint = 0, .lower = 0.5, .upper = 10}}});
  ModelSampler guarded(robot, joints, workspace, forbidden, {}, 1);
  Configuration here = Upright();
  for (int i = 0; i < 20; ++i) {
    here = guarded.Next(here).value();
    EXPECT_LE(here[0], 0.5);
  }
  EXPECT_FALSE(guarded.Next(Configuration{1, 0, 0, 0, 0, 0}).has_value());
}

TEST_F(SamplerTest, TheSameSeedGivesTheSamePlaces) {
  ModelSampler again(robot, joints, workspace, {}, {}, 1);
  ModelSampler other(robot, joints, workspace, {}, {}, 2);
  const Configuration first = sampler.Next(Upright()).value();
  EXPECT_EQ(again.Next(Upright()).value(), first);
  EXPECT_NE(other.Next(Upright()).value(), first);
}

}  // namespace
}  // namespace silhouette
