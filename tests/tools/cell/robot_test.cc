// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>

#include <cstdio>
#include <regex>
#include <variant>
#include <vector>

#include "tests/calib/robot/urdf_files.h"
#include "tests/folders.h"
#include "tests/test_folder.h"
#include "tests/tools/cell/cell_file.h"
#include "tools/cell/devices/open_devices.h"

namespace silhouette {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Pair;

// kBareCell with a driver.
std::string Driven(const std::string& driver) {
  return Changed("robot:\n", "robot:\n  driver: " + driver + "\n");
}

TEST(Cell, RobotIsDrivenByNobodyOrAsTheFileSays) {
  EXPECT_TRUE(std::holds_alternative<std::monostate>(Load(kBareCell)->robot.driver));
  EXPECT_TRUE(std::holds_alternative<SimulatedRobotDriver>(Load(Driven("sim"))->robot.driver));
  const auto least =
      Load(Driven("{simple_message: {host: robot, byte_order: big, joints: [b, a, c]}}"));
  ASSERT_TRUE(least.ok()) << least.status();
  const auto& settings = std::get<SimpleMessageSettings>(least->robot.driver);
  EXPECT_EQ(settings.host, "robot");
  EXPECT_EQ(settings.motion_port, 11000);
  EXPECT_EQ(settings.state_port, 11002);
  EXPECT_EQ(settings.byte_order, simple_message::ByteOrder::kBig);
  EXPECT_THAT(settings.joints, ElementsAre("b", "a", "c"));
  EXPECT_EQ(settings.trajectory, SimpleMessageSettings::Trajectory::kStreaming);
  EXPECT_EQ(settings.point, SimpleMessageSettings::PointMessage::kSimple);
  const auto all = Load(Driven(
      "{simple_message: {host: robot, byte_order: little, joints: [a, b, c], motion_port: 1,"
      " state_port: 2, trajectory: download, message: full, velocity: 0.5, timeout: 250 ms}}"));
  ASSERT_TRUE(all.ok()) << all.status();
  EXPECT_EQ(std::get<SimpleMessageSettings>(all->robot.driver).point,
            SimpleMessageSettings::PointMessage::kFull);
  EXPECT_EQ(std::get<SimpleMessageSettings>(all->robot.driver).velocity, 0.5);
  EXPECT_EQ(std::get<SimpleMessageSettings>(all->robot.driver).timeout, absl::Milliseconds(250));
}

TEST(Cell, RobotIsMovedByHandOrBySomebodysDriver) {
  auto cell = Load(Driven("manual"));
  ASSERT_TRUE(cell.ok()) << cell.status();
  EXPECT_FALSE(std::get<ManualRobotSettings>(cell->robot.driver).typed);
  cell = Load(Driven("{manual: {joints: typed}}"));
  ASSERT_TRUE(cell.ok()) << cell.status();
  EXPECT_TRUE(std::get<ManualRobotSettings>(cell->robot.driver).typed);
  cell = Load(Driven("{manual: {read: {grpc: {address: \"a:1\"}}}}"));
  ASSERT_TRUE(cell.ok()) << cell.status();
  const auto& manual = std::get<ManualRobotSettings>(cell->robot.driver);
  EXPECT_EQ(std::get<GrpcRobotSettings>(manual.read).address, "a:1");
  cell = Load(Driven("{grpc: {address: \"robot:50061\", timeout: 2 s}}"));
  ASSERT_TRUE(cell.ok()) << cell.status();
  EXPECT_EQ(std::get<GrpcRobotSettings>(cell->robot.driver).timeout, absl::Seconds(2));
  EXPECT_EQ(std::get<GrpcRobotSettings>(cell->robot.driver).tls, ClientTlsFiles());
  cell =
      Load(Driven("{grpc: {address: \"robot:1\", tls: {ca: a.pem, certificate: /b.pem, key: c}}}"));
  ASSERT_TRUE(cell.ok()) << cell.status();
  const ClientTlsFiles& tls = std::get<GrpcRobotSettings>(cell->robot.driver).tls;
  EXPECT_EQ(tls.ca, (TestFolder() / "a.pem").string());
  EXPECT_EQ(tls.certificate, "/b.pem");
  EXPECT_THAT(MessageOf(Driven("{grpc: {address: \"robot:1\", tls: {ca: a.pem}}}")),
              HasSubstr("certificate"));
  EXPECT_THAT(MessageOf(Driven("grpc")), HasSubstr("say 'grpc: {address"));
  EXPECT_THAT(MessageOf(Driven("{grpc: {}}")), HasSubstr("address"));
  EXPECT_THAT(MessageOf(Driven("{manual: {read: {}}}")), HasSubstr("is expected"));
  EXPECT_THAT(MessageOf(Driven("{manual: {joints: guessed}}")), HasSubstr("'typed' or"));
}

TEST(Cell, WrongDriverIsToldWithTheMend) {
  EXPECT_THAT(MessageOf(Driven("staubli")), HasSubstr("'staubli' is not known; known are 'sim'"));
  EXPECT_THAT(MessageOf(Driven("simple_message")), HasSubstr("say at least"));
  const auto with = [](const std::string& settings) {
    return MessageOf(Driven("{simple_message: {host: robot, " + settings + "}}"));
  };
  EXPECT_THAT(with("joints: [a]"), HasSubstr("byte_order"));
  EXPECT_THAT(with("byte_order: middle, joints: [a]"), HasSubstr("'big' or 'little'"));
  EXPECT_THAT(with("byte_order: big, joints: [a], message: long"), HasSubstr("'full' or"));
  EXPECT_THAT(with("byte_order: big"), HasSubstr("joints"));
  EXPECT_THAT(with("byte_order: big, joints: [a, a]"), HasSubstr("named twice"));
  EXPECT_THAT(with("byte_order: big, joints: [a], state_port: 0"), HasSubstr("a port of 1"));
  EXPECT_THAT(with("byte_order: big, joints: [a], velocity: 2"), HasSubstr("a share above 0"));
  EXPECT_THAT(with("byte_order: big, joints: [a], prot: 1"), HasSubstr("unknown key 'prot'"));
}

TEST(Cell, RobotImagesAreCapturedUnlessTheFileHasThemDrawn) {
  EXPECT_FALSE(Load(kBareCell)->robot.drawn.has_value());
  EXPECT_FALSE(DrawnCellOf(*Load(kBareCell))->has_value());
  const auto captured = Load(SixJoints("  images: captured\n", "grid: {max_move: 0.3}\n"));
  ASSERT_TRUE(captured.ok()) << captured.status();
  EXPECT_FALSE(captured->robot.drawn.has_value());

  const auto defaults = Load(SixJoints("  images: drawn\n"));
  ASSERT_TRUE(defaults.ok()) << defaults.status();
  EXPECT_EQ(defaults->robot.drawn->tolerance, 0.005);
  EXPECT_EQ(defaults->robot.drawn->geometry, BodyGeometry::kVisual);

  const auto cell = Load(SixJoints(
      "  payload_radius: 0.1\n  images: {drawn: {tolerance: 8 mm, geometry: collision}}\n",
      "capture: {forbidden_regions: [{name: door, joints: {joint_1: [0.5, 1]}}]}\n"));
  ASSERT_TRUE(cell.ok()) << cell.status();
  const auto drawn = DrawnCellOf(*cell);
  ASSERT_TRUE(drawn.ok() && drawn->has_value()) << drawn.status();
  EXPECT_EQ((*drawn)->parts.tolerance, 0.008);
  EXPECT_EQ((*drawn)->parts.geometry, BodyGeometry::kCollision);
  EXPECT_EQ((*drawn)->payload_radius, 0.1);
  EXPECT_EQ((*drawn)->robot->joints().size(), 6u);
  const Configuration before{0, 0, 0, 0, 0, 0};
  const Configuration within{0.7, 0, 0, 0, 0, 0};
  EXPECT_TRUE((*drawn)->forbidden.Between(before, within));
  EXPECT_FALSE((*drawn)->forbidden.Between(before, before));
}

TEST(Cell, ModelWithoutAMovingJointIsNamedAsSuch) {
  const std::string urdf = (TestFolder() / "still.urdf").string();
  std::ofstream(urdf) << "<robot name='r'><link name='a'/><link name='b'/><joint name='j' "
                         "type='fixed'><parent link='a'/><child link='b'/></joint></robot>";
  EXPECT_THAT(MessageOf("name: x\nrobot: {urdf: " + urdf +
                        ", images: drawn, joints: [{name: j}]}\nviews: [{name: top}]\n"),
              HasSubstr("the model has no moving joint 'j'; all of its joints are fixed: correct"));
}

TEST(Cell, WithoutAGridOnlyTheLimitsOfADrawnRobotAreKnown) {
  const auto cell = Load(SixJoints("  images: drawn\n"));
  ASSERT_TRUE(cell.ok()) << cell.status();
  EXPECT_EQ(cell->grid.size(), 64u);
  EXPECT_EQ(cell->grid_move, 0);
  std::string still = SixJoints("  images: drawn\n");
  still = std::regex_replace(still, std::regex("joint_6"), "joint_6, lower: 0, upper: 0");
  EXPECT_EQ(Load(still)->grid.size(), 32u);
  const auto gridded = Load(SixJoints("  images: drawn\n", "grid: {max_move: 0.3}\n"));
  EXPECT_GT(gridded->grid.size(), 100'000u);
}

TEST(Cell, GridOfAnArmHasOneValueForEachJointOfTheWrist) {
  const std::string images = "  images: {drawn: {arm_joints: 3}}\n";
  const auto cell = Load(SixJoints(images, "grid: {max_move: 0.3}\n"));
  ASSERT_TRUE(cell.ok()) << cell.status();
  EXPECT_EQ(cell->robot.arm_joints, 3);
  EXPECT_TRUE(cell->robot.drawn.has_value());
  const auto whole = Load(SixJoints("  images: drawn\n", "grid: {max_move: 0.3}\n"));
  EXPECT_EQ(whole->robot.arm_joints, 0);
  for (size_t j = 0; j < 6; ++j) {
    EXPECT_EQ(cell->grid.joints()[j].any(), j >= 3);
    EXPECT_EQ(cell->grid.joints()[j].lower, whole->grid.joints()[j].lower);
    EXPECT_EQ(cell->grid.joints()[j].upper, whole->grid.joints()[j].upper);
    if (j < 3) {
      EXPECT_EQ(cell->grid.joints()[j].steps, whole->grid.joints()[j].steps);
    }
  }
  const auto steps =
      Load(SixJoints(images, "grid: {steps: {joint_1: 9, joint_2: 8, joint_3: 7}}\n"));
  ASSERT_TRUE(steps.ok()) << steps.status();
  EXPECT_EQ(steps->grid.size(), 9u * 8 * 7);
}

TEST(Cell, MistakesInTheGridOfAnArmAreNamed) {
  const auto with = [](const std::string& joints, const std::string& rest) {
    return MessageOf(SixJoints("  images: {drawn: {arm_joints: " + joints + "}}\n", rest));
  };
  EXPECT_THAT(with("3", ""), HasSubstr("arm_joints needs a 'grid'"));
  EXPECT_THAT(with("0", "grid: {max_move: 0.3}\n"), HasSubstr("state at least 1"));
  EXPECT_THAT(with("6", "grid: {max_move: 0.3}\n"),
              HasSubstr("arm_joints is 6, and 6 joints move; state fewer"));
  EXPECT_THAT(with("3", "grid: {steps: {joint_1: 9, joint_2: 8, joint_3: 1}}\n"),
              HasSubstr("one step goes with lower == upper"));
  EXPECT_THAT(with("2", "grid: {steps: {joint_1: 9, joint_2: 8, joint_3: 1}}\n"),
              HasSubstr("'joint_3' is a joint of the wrist, as arm_joints is 2: leave it out"));
}

TEST(Cell, MistakesInDrawnImagesAreNamed) {
  EXPECT_THAT(MessageOf(SixJoints("  images: painted\n")), HasSubstr("captured"));
  EXPECT_THAT(MessageOf(SixJoints("  images: {drawn: {tolerance: 5 inch}}\n")),
              HasSubstr("a length is expected: metres, or e.g. '5 mm'"));
  EXPECT_THAT(MessageOf(SixJoints("  images: {drawn: {tolerances: 5 mm}}\n")),
              HasSubstr("tolerance"));
  EXPECT_THAT(MessageOf(SixJoints("")), HasSubstr("the cell needs a 'grid', unless"));
  EXPECT_THAT(MessageOf(Changed("  joints:", "  images: drawn\n  joints:")),
              HasSubstr("images are drawn from the robot's model; state urdf"));
}

TEST(Cell, MaxMoveGridObeysTheLargestMovementAndSumDividesIt) {
  const std::string robots = SourceFolder() + "/capture/sim/robots/";
  const auto steps = [&](const std::string& rule) {
    const absl::StatusOr<Cell> cell = Load("name: x\nrobot:\n  urdf: " + robots +
                                           "rx130.urdf\n  joints:\n"
                                           "    - {name: joint_1, lower: -1, upper: 1}\n"
                                           "    - {name: joint_3, lower: -1, upper: 1}\n"
                                           "  fixed: {joint_2: 90 deg, joint_4: 0, joint_5: 0, "
                                           "joint_6: 0}\n"
                                           "grid: {max_move: 0.1, max_move_rule: " +
                                           rule + "}\nviews: [{name: top}]\n");
    EXPECT_TRUE(cell.ok()) << cell.status();
    return std::vector<int>{cell->grid.joints()[0].steps, cell->grid.joints()[1].steps};
  };
  const std::vector<int> each = steps("each");
  const std::vector<int> sum = steps("sum");
  EXPECT_GT(each[0], each[1]) << "the base moves the robot further than the elbow";
  // The reach of about 1.5 m at the base bounds a step of 0.1 m to about 1/15 rad.
  EXPECT_GE(each[0], 25);
  EXPECT_LE(each[0], 45);
  EXPECT_NEAR(sum[0], 2 * each[0], 2);
}

TEST(Cell, JointValuesHaveTheUnitOfTheirKind) {
  const auto folder = FreshFolder();
  WriteFile(folder / "gripper.urdf", GripperUrdf());
  const auto load = [&](const std::string& urdf, const std::string& lower) {
    return Load("name: x\nrobot:\n" + urdf + "  joints: [{name: left, lower: " + lower +
                ", upper: 0.2}]\n" +
                (urdf.empty() ? ""
                              : "  fixed: {joint0: 0, joint1: 0, joint2: 0, joint3: 0, joint4: 0, "
                                "joint5: 0, joint6: 0}\n") +
                "grid: {steps: {left: 3}}\nviews: [{name: top}]\n");
  };
  const std::string urdf = "  urdf: " + (folder / "gripper.urdf").string() + "\n";
  const absl::StatusOr<Cell> finger = load(urdf, "50 mm");
  ASSERT_TRUE(finger.ok()) << finger.status();
  EXPECT_DOUBLE_EQ(finger->grid.joints()[0].lower, 0.05);
  EXPECT_THAT(std::string(load(urdf, "1 deg").status().message()),
              HasSubstr("joints[0].lower: a position is expected"));
  EXPECT_THAT(std::string(load("", "-90").status().message()),
              HasSubstr("joints[0].lower: that is more than two turns; write degrees as '90 deg'"));
  const absl::StatusOr<Cell> bare = load("", "-50 cm");
  ASSERT_TRUE(bare.ok()) << bare.status();
  EXPECT_DOUBLE_EQ(bare->grid.joints()[0].lower, -0.5);
}

// Of two fingers one mimics the other, and a tip turns as that one slides.
TEST(Cell, MaxMoveCountsJointsThatMimic) {
  const auto folder = FreshFolder();
  WriteFile(folder / "gripper.urdf", GripperUrdf());
  const absl::StatusOr<Cell> cell = Load(
      "name: x\nrobot:\n  urdf: " + (folder / "gripper.urdf").string() +
      "\n  joints: [{name: left}]\n"
      "  fixed: {joint0: 0, joint1: 0, joint2: 0, joint3: 0, joint4: 0, joint5: 0, joint6: 0}\n"
      "grid: {max_move: 0.05}\nviews: [{name: top}]\n");
  ASSERT_TRUE(cell.ok()) << cell.status();
  // The finger's 0.5 m alone would take eleven steps.
  EXPECT_GT(cell->grid.joints()[0].steps, 12);
  EXPECT_LE(cell->grid_move, 0.05);
  EXPECT_TRUE(cell->joint_slides.at("left"));
  EXPECT_FALSE(cell->joint_slides.at("joint1"));
}

// A robot without a URDF that an operator moves.
constexpr char kRail[] =
    "name: x\nrobot:\n  driver: manual\n  joints:\n    - {name: rail, lower: 0, upper: 1 m}\n"
    "    - {name: turn, lower: 0, upper: 90 deg}\n  fixed: {lift: 20 cm, tilt: 0.5}\n"
    "grid: {steps: {rail: 3, turn: 3}}\nviews: [{name: top}]\n";

TEST(Cell, JointsWithoutAModelSlideIfTheirValuesAreLengths) {
  const absl::StatusOr<Cell> cell = Load(kRail);
  ASSERT_TRUE(cell.ok()) << cell.status();
  EXPECT_THAT(cell->joint_slides, ElementsAre(Pair("lift", true), Pair("rail", true)));
  EXPECT_THAT(Load(kBareCell)->joint_slides, IsEmpty());
}

TEST(Cell, OperatorReadsMillimetresOfAJointThatSlidesAlsoWithoutAModel) {
  const absl::StatusOr<Cell> cell = Load(kRail);
  ASSERT_TRUE(cell.ok()) << cell.status();
  const auto robot = OpenRobot(*cell, nullptr);
  ASSERT_TRUE(robot.ok()) << robot.status();
  ASSERT_NE(std::freopen("/dev/null", "r", stdin), nullptr) << "no operator answers";
  testing::internal::CaptureStderr();
  EXPECT_FALSE((*robot)->MoveTo(std::vector<double>{1, 0.5, 0.2, 0.5}).ok());
  EXPECT_THAT(testing::internal::GetCapturedStderr(),
              HasSubstr("rail 1000.00 mm, turn 28.65 deg, lift 200.00 mm, tilt 28.65 deg"));
}

TEST(Cell, JointsThatTheModelLacksOrThatAreNotNamedAreTold) {
  const std::string robots = SourceFolder() + "/capture/sim/robots/";
  const auto message = [&](const std::string& joint, const std::string& fixed) {
    return MessageOf("name: x\nrobot:\n  urdf: " + robots + "rx130.urdf\n  joints: [" + joint +
                     "]\n  fixed: " + fixed + "\ngrid: {max_move: 0.1}\nviews: [{name: top}]\n");
  };
  EXPECT_THAT(message("{name: joint_7}", "{}"), HasSubstr("joint_7"));
  EXPECT_THAT(message("{name: joint_1}", "{joint_2: 0}"),
              HasSubstr("say where 'joint_3', 'joint_4', 'joint_5' and 'joint_6' stand"));
  EXPECT_THAT(message("{name: joint_1, upper: 300 deg}", "{}"), HasSubstr("limit"));
}

}  // namespace
}  // namespace silhouette
