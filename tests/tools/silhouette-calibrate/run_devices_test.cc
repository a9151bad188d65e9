// SPDX-License-Identifier: Apache-2.0
// silhouette-calibrate run on a robot and a camera that do what a test says. The camera always
// shows the board.
#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <functional>
#include <memory>
#include <numbers>
#include <opencv2/core.hpp>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/str_split.h"
#include "absl/time/clock.h"
#include "calib/boards/board.h"
#include "calib/robot/robot_model.h"
#include "capture/sim/served/grpc_robot_server.h"
#include "capture/sim/served/simulated_controller.h"
#include "silhouette/v1/camera_driver.grpc.pb.h"
#include "tests/calib/detection/rendered_board.h"
#include "tests/folders.h"
#include "tests/shell.h"

namespace silhouette {
namespace {

using testing::AllOf;
using testing::DoubleNear;
using testing::Each;
using testing::HasSubstr;
using testing::SizeIs;

const std::string kArmUrdf = SourceFolder() + "/capture/sim/robots/rx130.urdf";

// Of the cell, for that robot.
constexpr char kArmJoints[] =
    "  joints:\n"
    "    - {name: joint_1, lower: -150 deg, upper: 150 deg}\n"
    "    - {name: joint_3, lower: 80 deg, upper: 100 deg}\n"
    "  fixed: {joint_2: 40 deg, joint_4: 0, joint_5: 20 deg, joint_6: 0}\n"
    "grid: {steps: {joint_1: 3, joint_3: 3}}\n";
const std::vector<double> kArmStart = {0.1, 0.7, 1.5, 0, 0.35, 0};

// Of a URDF: a link and the joint that carries it, about or along the vertical.
std::string Joint(const std::string& name, const std::string& type, const std::string& parent,
                  const std::string& child) {
  return absl::StrCat("<link name='", child, "'/><joint name='", name, "' type='", type,
                      "'><parent link='", parent, "'/><child link='", child,
                      "'/><origin xyz='0.3 0 0'/><axis xyz='0 0 1'/>",
                      "<limit lower='-2' upper='2'/></joint>");
}

// The camera "left", as it says of 240 x 180 pixels.
class OwnCamera : public v1::CameraDriverService::Service {
 public:
  explicit OwnCamera(cv::Mat image) : image_(std::move(image)) {
    int port = 0;
    grpc::ServerBuilder builder;
    builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port);
    builder.RegisterService(this);
    server_ = builder.BuildAndStart();
    address_ = absl::StrCat("127.0.0.1:", port);
  }

  const std::string& address() const { return address_; }
  void Show(const cv::Mat& image) { image_ = image; }
  // Called with the number of an image, from 1, before it is sent.
  void Before(std::function<grpc::Status(int)> before) { before_ = std::move(before); }

  grpc::Status GetCameras(grpc::ServerContext*, const v1::GetCamerasRequest*,
                          v1::GetCamerasResponse* response) override {
    v1::DriverCamera* camera = response->add_cameras();
    camera->set_name("left");
    camera->set_width(240);
    camera->set_height(180);
    return grpc::Status::OK;
  }

  grpc::Status Grab(grpc::ServerContext*, const v1::GrabRequest*,
                    v1::GrabResponse* response) override {
    if (const grpc::Status status = before_(++images_); !status.ok()) return status;
    v1::RawImage& raw = *response->add_images()->mutable_raw();
    raw.set_width(image_.cols);
    raw.set_height(image_.rows);
    raw.set_channels(1);
    raw.set_pixels(image_.data, image_.total());
    return grpc::Status::OK;
  }

 private:
  cv::Mat image_;
  std::function<grpc::Status(int)> before_ = [](int) { return grpc::Status::OK; };
  int images_ = 0;
  std::string address_;
  std::unique_ptr<grpc::Server> server_;
};

class RunOnOwnDevices : public ProgramTest {
 protected:
  RunOnOwnDevices()
      : ProgramTest(
            "silhouette-calibrate run --cell cell.yaml --boards boards.yaml --out session "
            "--floor=-5") {
    Write("boards.yaml", BoardFileText(std::vector{board_}));
  }

  cv::Mat BoardImage() const {
    std::mt19937_64 random(1);
    const Eigen::Isometry3d pose = RandomPose(board_, 0.35, 0.3, random);
    return RenderedBoard(board_, Intrinsics(240, 180, 300, -0.2), pose, {}, random).image().clone();
  }

  // A robot that stands at `start`; `joints`: the cell's, and its grid.
  void StartRobot(const std::string& urdf, const std::vector<double>& start,
                  const std::string& joints) {
    StopRobot();
    controller_ = std::make_unique<SimulatedController>(RobotModel::FromUrdf(urdf).value(), 0,
                                                        start, [](std::span<const double>) {});
    auto server = GrpcRobotServer::Start(*controller_, "127.0.0.1:0");
    ASSERT_TRUE(server.ok()) << server.status();
    server_ = *std::move(server);
    Write("cell.yaml",
          absl::StrCat("name: own\nrobot:\n  driver: {grpc: {address: \"", server_->address(),
                       "\", timeout: 20 s}}\n  urdf: ", urdf, "\n", joints,
                       "views:\n  - {name: left, noise: none, source: {grpc: {address: \"",
                       camera_.address(),
                       "\", camera: left, timeout: 20 s}}, image_size: [240, 180], "
                       "mask_size: [60, 45]}\n"
                       "capture: {settle: 5 ms, joint_speed: 6}\n"));
  }
  void StopRobot() {
    server_.reset();
    controller_.reset();
  }

  // The values of a joint in the frames of joints.csv.
  std::vector<double> ValuesOf(const std::string& joint) const {
    const std::vector<std::string> lines =
        absl::StrSplit(Read("session/joints.csv"), '\n', absl::SkipEmpty());
    if (lines.empty()) return {};
    const std::vector<std::string> names = absl::StrSplit(lines[0], ',');
    const size_t column = static_cast<size_t>(std::ranges::find(names, joint) - names.begin());
    std::vector<double> values;
    for (size_t i = 1; i < lines.size(); ++i) {
      const std::vector<std::string> cells = absl::StrSplit(lines[i], ',');
      EXPECT_TRUE(absl::SimpleAtod(cells.at(column), &values.emplace_back())) << lines[i];
    }
    return values;
  }

  const Board board_{{.name = "flange", .rows = 1, .columns = 2, .tag_size = 0.05, .gap = 0.05}};
  OwnCamera camera_{BoardImage()};
  std::unique_ptr<SimulatedController> controller_;
  std::unique_ptr<GrpcRobotServer> server_;
};

TEST_F(RunOnOwnDevices, GridJointsThatAreNotNamedStayInPlaceOrGoToTheNearestEndOfTheirRange) {
  constexpr double kLower = 80 * std::numbers::pi / 180;
  for (const auto& [stands, stays] : {std::pair(1.5, 1.5), std::pair(1.2, kLower)}) {
    std::filesystem::remove_all(folder_ / "session");
    StartRobot(kArmUrdf, {0.1, 0.7, stands, 0, 0.35, 0}, kArmJoints);
    const Ended ended = Run("--frames 3 --joint joint_1=0:0.3");
    EXPECT_THAT(ValuesOf("joint_3"), AllOf(SizeIs(3), Each(DoubleNear(stays, 0.01)))) << ended.err;
  }
}

TEST_F(RunOnOwnDevices, ASlideThatIsNotInTheGridStaysWhereItIsFixed) {
  Write("scara.urdf", absl::StrCat("<robot name='scara'><link name='base'/>",
                                   Joint("shoulder", "revolute", "base", "upper_arm"),
                                   Joint("elbow", "revolute", "upper_arm", "forearm"),
                                   Joint("slide", "prismatic", "forearm", "quill"),
                                   Joint("wrist", "revolute", "quill", "flange"), "</robot>"));
  StartRobot((folder_ / "scara.urdf").string(), {0, 0, 0, 0},
             "  joints:\n    - {name: shoulder}\n    - {name: elbow}\n"
             "  fixed: {slide: 0.1 m, wrist: 0}\n"
             "grid: {steps: {shoulder: 3, elbow: 3}}\n");
  const Ended ended = Run("--frames 3");
  EXPECT_THAT(ValuesOf("slide"), AllOf(SizeIs(3), Each(DoubleNear(0.1, 0.003)))) << ended.err;
}

TEST_F(RunOnOwnDevices, AContinuousJointThatIsNotNamedStaysInItsTurn) {
  constexpr double kStands = 2 * std::numbers::pi + 0.1;
  Write("table.urdf", absl::StrCat("<robot name='table'><link name='base'/>",
                                   Joint("turn", "continuous", "base", "table"),
                                   Joint("arm", "revolute", "table", "flange"), "</robot>"));
  StartRobot((folder_ / "table.urdf").string(), {kStands, 0},
             "  joints:\n    - {name: turn}\n    - {name: arm}\n"
             "grid: {steps: {turn: 3, arm: 3}}\n");
  const Ended ended = Run("--frames 3 --joint arm=0:0.3");
  EXPECT_THAT(ValuesOf("turn"), AllOf(SizeIs(3), Each(DoubleNear(kStands, 0.01)))) << ended.err;
}

TEST_F(RunOnOwnDevices, AnImageThatDoesNotComeIsAskedForAgain) {
  StartRobot(kArmUrdf, kArmStart, kArmJoints);
  camera_.Before([](int image) {
    return image == 2 ? grpc::Status(grpc::StatusCode::UNAVAILABLE, "lost") : grpc::Status::OK;
  });
  const Ended ended = Run("--frames 3 --joint joint_1=0:0.3");
  EXPECT_THAT(ended.err, HasSubstr("images asked for again: "));
  EXPECT_THAT(ValuesOf("joint_1"), SizeIs(3)) << ended.err;
}

TEST_F(RunOnOwnDevices, AnImageThatAFrozenCameraRepeatsIsNoFrame) {
  StartRobot(kArmUrdf, kArmStart, kArmJoints);
  Write("cell.yaml", absl::StrReplaceAll(Read("cell.yaml"), {{"noise: none, ", ""}}));
  const Ended ended = Run("--frames 3 --joint joint_1=0:0.3");
  EXPECT_EQ(ended.exit_code, 3) << ended.err;
  EXPECT_THAT(ended.err, HasSubstr("the camera of the view 'left' is frozen"));
  EXPECT_THAT(ValuesOf("joint_1"), SizeIs(1));
}

// A robot that is moved by hand: no driver watches whether it keeps its place.
TEST_F(RunOnOwnDevices, ImagesDuringWhichTheRobotMovedAreNoFrame) {
  StartRobot(kArmUrdf, kArmStart, kArmJoints);
  Write("cell.yaml", absl::StrReplaceAll(Read("cell.yaml"),
                                         {{"driver: {grpc:", "driver: {manual: {read: {grpc:"},
                                          {"}}\n  urdf:", "}}}}\n  urdf:"}}));
  Write("poses.csv",
        "joint_1,joint_2,joint_3,joint_4,joint_5,joint_6\n"
        "0.1,0.7,1.5,0,0.35,0\n0.1,0.7,1.5,0,0.35,0\n");
  Write("enters.txt", "\n\n\n\n");
  camera_.Before([&](int image) {
    if (image == 2) {
      std::vector<double> elsewhere = kArmStart;
      elsewhere[2] += 0.05;
      EXPECT_TRUE(controller_->Move(elsewhere, absl::ZeroDuration()).ok());
      absl::SleepFor(absl::Seconds(3));  // until it stands again
    }
    return grpc::Status::OK;
  });
  const Ended ended = Run("--poses poses.csv <enters.txt");
  EXPECT_EQ(ended.exit_code, 3) << ended.err;
  EXPECT_THAT(ended.err,
              AllOf(HasSubstr("joint_3 moved by 0.0500 rad while images were taken, more "
                              "than 0.0020 (capture: joint_tolerance)"),
                    HasSubstr("1 frames are kept")));
  EXPECT_THAT(ValuesOf("joint_1"), SizeIs(1));
}

TEST_F(RunOnOwnDevices, ImagesOfAnotherSizeThanTheCellsAreNoFrame) {
  StartRobot(kArmUrdf, kArmStart, kArmJoints);
  camera_.Show(BoardImage().rowRange(0, 170).clone());
  const Ended ended = Run("--frames 3 --joint joint_1=0:0.3");
  EXPECT_EQ(ended.exit_code, 2) << ended.err;
  EXPECT_THAT(ended.err, HasSubstr("240 x 170 pixels; the cell says 240 x 180"));
  EXPECT_THAT(ValuesOf("joint_1"), SizeIs(0));
}

TEST_F(RunOnOwnDevices, LostCornersAreFoundAgainInTheImagesOfTheSession) {
  StartRobot(kArmUrdf, kArmStart, kArmJoints);
  const std::string options = "--frames 3 --joint joint_1=0:0.3";
  const Ended first = Run(options);
  const std::string joints = Read("session/joints.csv");
  const std::string corners = Read("session/corners.csv");
  ASSERT_THAT(joints, HasSubstr("\n0003,")) << first.err;
  std::filesystem::remove(folder_ / "session/corners.csv");
  StopRobot();
  const Ended again = Run(options + " --resume");
  EXPECT_EQ(Read("session/joints.csv"), joints) << again.err;
  EXPECT_EQ(Read("session/corners.csv"), corners) << again.err;
}

TEST_F(RunOnOwnDevices, CamerasOfAnEarlierSolutionAreNamedWhenANewOneIsRefused) {
  StartRobot(kArmUrdf, kArmStart, kArmJoints);
  Write("session/cameras/left.cameramodel", "");
  const Ended ended = Run("--frames 3 --joint joint_1=0:0.3");
  EXPECT_NE(ended.exit_code, 0);
  EXPECT_THAT(ended.err, HasSubstr("those in 'session/cameras' are of an earlier solution"));
}

}  // namespace
}  // namespace silhouette
