// SPDX-License-Identifier: Apache-2.0
// A whole capture session with a robot behind a connection: the same robot images as with the
// simulated robot in process, and a fault on the way ends it so that the next one goes on.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <map>
#include <memory>

#include "capture/drivers/robots/feedback_robot.h"
#include "capture/drivers/robots/simple_message_link.h"
#include "capture/session/capture_session.h"
#include "capture/session/reference_images.h"
#include "capture/sim/served/simple_message_server.h"
#include "capture/sim/served/simulated_controller.h"
#include "tests/capture/sim/small_cell.h"
#include "tests/test_folder.h"

namespace silhouette {
namespace {

using testing::HasSubstr;

storage::v1::CellDescription Description() {
  storage::v1::CellDescription cell;
  cell.set_name("served");
  const auto add_joint = [&](const std::string& name, double lower, double upper) {
    storage::v1::GridJoint& joint = *cell.add_grid_joints();
    joint.set_name(name);
    joint.set_lower(lower);
    joint.set_upper(upper);
    joint.set_steps(3);
  };
  add_joint("turn", -0.5, 0.5);
  add_joint("bend", -0.5, 0.5);
  storage::v1::FixedJoint& fixed = *cell.add_fixed_joints();
  fixed.set_name("slide");
  fixed.set_position(0.1);
  for (const char* name : {"top", "front"}) {
    storage::v1::View& view = *cell.add_views();
    view.set_name(name);
    view.set_image_width(160);
    view.set_image_height(120);
    view.set_mask_width(32);
    view.set_mask_height(24);
  }
  cell.set_segmentation(Describe(SegmentationSettings{}));
  return cell;
}

// A simulated cell, its database and its cameras.
class ServedSession : public testing::Test {
 protected:
  void SetUp() override {
    simulation_ = std::make_shared<SimulatedCell>(ThreeJointRobot(), SmallSimulation());
    const std::vector<SimulatedView> views = {{"top", 160, 120}, {"front", 160, 120}};
    rig_ = *SimulatedCameraRig::Create(simulation_, views);
  }

  // A database with reference images.
  std::unique_ptr<Database> NewDatabase(const std::string& name) {
    auto database = *Database::Create(folder_ / name, Description());
    simulation_->SetRobotPresent(false);
    auto cameras = CellCameras::Create(database->cell(), *rig_, {});
    const auto references = TakeReferences(*cameras, 3);
    EXPECT_TRUE(database->SetReferences(*references, "test").ok());
    simulation_->SetRobotPresent(true);
    return database;
  }

  CaptureReport Capture(Database& database, Robot& robot, const CaptureObserver& observer = {}) {
    CaptureSettings settings;
    settings.settle = absl::ZeroDuration();
    settings.first_look.may_be_cut = true;  // thin parts reach the front view's border
    const Travel travel(database.grid(), {});
    auto session =
        CaptureSession::Create(database, travel, robot, *rig_, settings, SegmentationSettings{});
    EXPECT_TRUE(session.ok()) << session.status();
    const auto records = ReadRecords(database);
    const auto plan = PlanCapture(database.cell(), travel, *records, settings, {});
    return session->Run(*plan, "test", observer);
  }

  static std::map<ConfigurationNumber, std::vector<Mask>> Masks(const Database& database) {
    std::map<ConfigurationNumber, std::vector<Mask>> masks;
    const absl::Status status =
        database.Read()->ForEach([&](ConfigurationNumber number, auto image) {
          masks[number] = image->masks;
          return true;
        });
    EXPECT_TRUE(status.ok()) << status;
    return masks;
  }

  const std::filesystem::path folder_ = FreshFolder();
  std::shared_ptr<SimulatedCell> simulation_;
  std::unique_ptr<SimulatedCameraRig> rig_;
};

TEST_F(ServedSession, RobotThatMovesByItselfEndsItAndTheNextGoesOnToTheSameImages) {
  const auto in_process = NewDatabase("in_process");
  SimulatedRobot simulated(simulation_);
  const CaptureReport whole = Capture(*in_process, simulated);
  ASSERT_TRUE(whole.complete()) << whole.status << " " << whole.alarm;

  SimulatedController controller(simulation_);
  const auto server = *SimpleMessageServer::Start(controller, {});
  const auto connect = [&] {
    return std::make_unique<FeedbackRobot>(
        *SimpleMessageLink::Connect({.host = "127.0.0.1",
                                     .motion_port = server->motion_port(),
                                     .state_port = server->state_port(),
                                     .joints = {"turn", "bend", "slide"},
                                     .timeout = absl::Seconds(20)}),
        MotionLimits{.joint_speed = 8, .silence = absl::Seconds(20)});
  };
  const auto served = NewDatabase("served");
  auto robot = connect();
  CaptureObserver observer;
  observer.progress = [&](uint64_t done) {
    if (done == 4) controller.SetFault(ControllerFault::kDrifts);
  };
  const CaptureReport report = Capture(*served, *robot, observer);
  EXPECT_TRUE(absl::IsAborted(report.status)) << report.status;
  EXPECT_GE(report.captured, 4u);
  EXPECT_LT(report.captured, 9u);
  EXPECT_GT(controller.stops(), 0);
  EXPECT_FALSE(controller.state().moving);

  controller.SetFault(ControllerFault::kNone);
  robot = connect();
  const CaptureReport resumed = Capture(*served, *robot);
  EXPECT_TRUE(resumed.complete()) << resumed.status;
  EXPECT_EQ(Masks(*served), Masks(*in_process));
}

}  // namespace
}  // namespace silhouette
