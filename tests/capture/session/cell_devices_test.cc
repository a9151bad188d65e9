// SPDX-License-Identifier: Apache-2.0
// The devices of a cell by name: robot, cameras, reference images.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "capture/devices/running_clock.h"
#include "capture/session/cell_cameras.h"
#include "capture/session/cell_robot.h"
#include "tests/capture/segmentation/images.h"
#include "tests/capture/session/fake_cell.h"

namespace silhouette {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

TEST(CellRobot, JointsAreCommandedByNameAndFixedOnesStandStill) {
  FakeRobot robot;
  auto cell = CellRobot::Create(FakeDescription(), robot);
  ASSERT_TRUE(cell.ok()) << cell.status();
  ASSERT_TRUE(cell->MoveTo({0.5, 0.1}).ok());
  EXPECT_THAT(robot.moves.back(), ElementsAre(0.25, 0.1, 0.5));  // wrist, lift, turn
  EXPECT_THAT(*cell->Measure(), ElementsAre(0.5, 0.1, 0.25));    // turn, lift, wrist
  EXPECT_THAT(cell->Commanded({0.5, 0.1}), ElementsAre(0.5, 0.1, 0.25));
}

TEST(CellRobot, JointThatTheRobotLacksIsTold) {
  FakeRobot robot;
  robot.names = {"wrist", "lift", "shoulder"};
  const absl::Status status = CellRobot::Create(FakeDescription(), robot).status();
  EXPECT_TRUE(absl::IsInvalidArgument(status));
  EXPECT_THAT(status.message(), HasSubstr("no joint 'turn'"));
  EXPECT_THAT(status.message(), HasSubstr("wrist, lift, shoulder"));
}

TEST(CellRobot, JointThatTheCellDoesNotNameIsTold) {
  FakeRobot robot;
  robot.names.push_back("gripper");
  const absl::Status status = CellRobot::Create(FakeDescription(), robot).status();
  EXPECT_TRUE(absl::IsInvalidArgument(status));
  EXPECT_THAT(status.message(), HasSubstr("'gripper' is not in the cell"));
}

TEST(CellRobot, DeviationIsThatOfTheWorstJoint) {
  FakeRobot robot;
  storage::v1::CellDescription description = FakeDescription();
  description.mutable_grid_joints(0)->set_continuous(true);
  const auto cell = CellRobot::Create(description, robot);
  EXPECT_DOUBLE_EQ(cell->Deviation({1, 2, 3}, {1, 2.25, 2.9}), 0.25);
  EXPECT_NEAR(cell->Deviation({-3.1, 2, 3}, {-3.1 + 2 * std::numbers::pi, 2, 3}), 0, 1e-12);
  EXPECT_GT(cell->Deviation({1, 2, 3}, {1, 2 + 2 * std::numbers::pi, 3}), 6);
  EXPECT_EQ(cell->Deviation({1, 2, 3}, {1, std::nan(""), 3}), INFINITY);
}

TEST(CellRobot, RobotThatMovesIsNotMeasured) {
  FakeRobot robot;
  auto cell = CellRobot::Create(FakeDescription(), robot);
  robot.moving = true;
  EXPECT_TRUE(absl::IsAborted(cell->Measure().status()));
}

TEST(CellRobot, StateOfBeforeTheMomentIsAskedForAgain) {
  FakeRobot robot;
  auto cell = CellRobot::Create(FakeDescription(), robot);
  const absl::Duration since = RunningNow();
  int asked = 0;
  robot.on_state = [&](RobotState& state) {
    const bool late = ++asked == 3;
    state.positions = {0, 0, late ? 0.5 : 0};
    state.not_before = late ? since : since - absl::Nanoseconds(1);
    return absl::OkStatus();
  };
  EXPECT_THAT(*cell->Measure(), ElementsAre(0, 0, 0));
  EXPECT_THAT(*cell->Measure(since), ElementsAre(0.5, 0, 0));
  EXPECT_EQ(asked, 3);
  robot.on_state = [&](RobotState& state) {
    state.not_before = since - absl::Seconds(1);
    return ++asked < 6 ? absl::OkStatus() : absl::UnavailableError("lost");
  };
  EXPECT_TRUE(absl::IsUnavailable(cell->Measure(since).status()));
}

class CellCamerasTest : public testing::Test {
 protected:
  absl::StatusOr<ImageSet> Grab() {
    auto cameras = CellCameras::Create(FakeDescription(), rig_, {});
    EXPECT_TRUE(cameras.ok()) << cameras.status();
    return cameras->Grab([&](const std::string& line) { said_.push_back(line); });
  }

  FakeRobot robot_;
  FakeRig rig_{robot_};
  std::vector<std::string> said_;
};

TEST_F(CellCamerasTest, ImagesComeInTheOrderOfTheCell) {
  const auto set = Grab();
  ASSERT_TRUE(set.ok()) << set.status();
  ASSERT_EQ(set->images.size(), 2u);
  EXPECT_EQ(set->images[0].size(), cv::Size(80, 60));
  EXPECT_EQ(set->images[1].size(), cv::Size(64, 64));
}

TEST_F(CellCamerasTest, TimeIsThatOfTheOldestImage) {
  const absl::Time early = absl::UnixEpoch() + absl::Seconds(5);
  rig_.on_grab = [&](size_t, std::vector<CameraImage>& images) {
    images[1].captured = early;
    return absl::OkStatus();
  };
  EXPECT_EQ(Grab()->captured, early);
}

TEST_F(CellCamerasTest, ViewWithoutACameraIsTold) {
  rig_.names = {"top", "back"};
  const absl::Status status = CellCameras::Create(FakeDescription(), rig_, {}).status();
  EXPECT_TRUE(absl::IsInvalidArgument(status));
  EXPECT_THAT(status.message(), HasSubstr("no camera for the view 'front'; there are top, back"));
}

TEST_F(CellCamerasTest, LostSetIsAskedForAgain) {
  rig_.on_grab = [](size_t grab, std::vector<CameraImage>&) {
    return grab < 3 ? absl::UnavailableError("view 'top': no image") : absl::OkStatus();
  };
  EXPECT_TRUE(Grab().ok());
  EXPECT_THAT(said_, ElementsAre(HasSubstr("view 'top'"), HasSubstr("view 'top'")));
}

TEST_F(CellCamerasTest, CameraThatStaysSilentIsAnError) {
  rig_.on_grab = [](size_t, std::vector<CameraImage>&) {
    return absl::DeadlineExceededError("view 'top': no image within 2 s");
  };
  const absl::Status status = Grab().status();
  EXPECT_TRUE(absl::IsDeadlineExceeded(status));
  EXPECT_THAT(status.message(), HasSubstr("view 'top'"));
  EXPECT_EQ(rig_.grabs, 3u);
}

TEST_F(CellCamerasTest, ImageOfTheWrongSizeIsToldWithItsView) {
  rig_.on_grab = [](size_t, std::vector<CameraImage>& images) {
    images[1] = {.width = 40, .height = 30, .pixels = std::vector<uint8_t>(1200)};
    return absl::OkStatus();
  };
  EXPECT_THAT(Grab().status().message(),
              HasSubstr("the view 'front' gave an image of 40 x 30 pixels; the cell says 80 x 60: "
                        "set the camera to that size, or correct image_size"));
}

TEST_F(CellCamerasTest, IncompleteSetsAndImagesAreErrors) {
  rig_.on_grab = [](size_t, std::vector<CameraImage>& images) {
    images.pop_back();
    return absl::OkStatus();
  };
  EXPECT_TRUE(absl::IsInternal(Grab().status()));
  rig_.on_grab = [](size_t, std::vector<CameraImage>& images) {
    images[0].pixels.pop_back();
    return absl::OkStatus();
  };
  EXPECT_TRUE(absl::IsInternal(Grab().status()));
  rig_.on_grab = [](size_t, std::vector<CameraImage>& images) {
    images[0].channels = 2;
    return absl::OkStatus();
  };
  EXPECT_TRUE(absl::IsInternal(Grab().status()));
}

TEST(ReferenceImages, ComeBackFromTheDatabaseAsTheyWere) {
  FakeCell cell;
  cell.rig.robot_present = false;
  cell.TakeReferences();
  const auto references = ReadReferences(*cell.database);
  ASSERT_TRUE(references.ok()) << references.status();
  ASSERT_EQ(references->size(), 2u);
  cell.rig.robot_present = false;
  auto cameras = CellCameras::Create(cell.database->cell(), cell.rig, {});
  const auto set = cameras->Grab([](const std::string&) {});
  for (size_t v = 0; v < 2; ++v) {
    cv::Mat mean;
    (*references)[v].mean().convertTo(mean, CV_8U, 1.0 / Reference::kGreyLevel);
    EXPECT_TRUE(SamePixels(mean, set->images[v]));
  }
}

TEST(ReferenceImages, NoneYetIsTold) {
  FakeCell cell;
  EXPECT_TRUE(absl::IsNotFound(ReadReferences(*cell.database).status()));
}

TEST(ReferenceImages, OfAnotherImageSizeAreRefused) {
  FakeCell cell;
  const std::vector<cv::Mat> images(2, cv::Mat(30, 30, CV_8UC1, cv::Scalar(80)));
  const Reference reference = Reference::FromImages(images);
  storage::v1::References references;
  for (int v = 0; v < 2; ++v) {
    references.add_views()->set_mean_png(reference.MeanPng());
    references.mutable_views(v)->set_noise_png(reference.NoisePng());
  }
  ASSERT_TRUE(cell.database->SetReferences(references, "test").ok());
  const absl::Status status = ReadReferences(*cell.database).status();
  EXPECT_TRUE(absl::IsFailedPrecondition(status)) << status;
  EXPECT_THAT(status.message(), HasSubstr("'front' has 30 x 30 pixels"));
}

TEST(ReferenceImages, WhatMovesMeanwhileIsFoundInItsView) {
  FakeCell cell;
  cell.rig.robot_present = false;
  auto cameras = CellCameras::Create(cell.database->cell(), cell.rig, {});
  std::vector<MovedInView> moved;
  ASSERT_TRUE(TakeReferences(*cameras, 5, {}, &moved).ok());
  EXPECT_TRUE(moved.empty());
  // Somebody passes through "top" in the third set, and is gone in the last.
  cell.rig.grabs = 0;
  cell.rig.on_grab = [](size_t grab, std::vector<CameraImage>& images) {
    for (int y = 20; y < 30 && grab == 3; ++y) {
      for (int x = 10; x < 15; ++x) images[0].pixels[static_cast<size_t>(y * 64 + x)] = 200;
    }
    return absl::OkStatus();
  };
  ASSERT_TRUE(TakeReferences(*cameras, 5, {}, &moved).ok());
  ASSERT_EQ(moved.size(), 1u);
  EXPECT_EQ(cell.database->cell().views(static_cast<int>(moved[0].view)).name(), "top");
  EXPECT_EQ(cv::countNonZero(moved[0].moved), 50);
  EXPECT_EQ(cv::countNonZero(moved[0].moved({10, 20, 5, 10})), 50);
}

TEST(ReferenceImages, AreNotTakenOfAFrozenCamera) {
  FakeCell cell;
  auto cameras = CellCameras::Create(cell.database->cell(), cell.rig, {"front"});
  const absl::Status status = TakeReferences(*cameras, 5).status();
  EXPECT_TRUE(absl::IsUnavailable(status)) << status;
  EXPECT_THAT(status.message(),
              HasSubstr("the camera of the view 'front' is frozen: it repeats an image"));
  EXPECT_EQ(cell.rig.grabs, 2u);
  cell.rig.on_grab = [](size_t grab, std::vector<CameraImage>& images) {
    images[1].pixels[0] = static_cast<uint8_t>(60 + grab % 2);
    return absl::OkStatus();
  };
  EXPECT_TRUE(TakeReferences(*cameras, 5).ok());
}

TEST(ReferenceImages, StopLeavesTheDatabaseAsItWas) {
  FakeCell cell;
  auto cameras = CellCameras::Create(cell.database->cell(), cell.rig, {});
  CaptureObserver observer;
  observer.stop_requested = [&] { return cell.rig.grabs == 2; };
  const auto references = TakeReferences(*cameras, 5, observer);
  EXPECT_TRUE(absl::IsCancelled(references.status()));
}

}  // namespace
}  // namespace silhouette
