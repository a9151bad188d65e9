// SPDX-License-Identifier: Apache-2.0
#include "tools/cell/robot_in_images.h"

#include <gmock/gmock.h>

#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "calib/camera/calibration.h"
#include "calib/files/calibration_message.h"
#include "calib/robot/drawn_cell.h"
#include "tests/tools/cell/cell_file.h"
#include "tools/cell/expected_robot.h"

namespace silhouette {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

// A slide along x with a box of 0.1 m, on a base that the rim of every image cuts.
std::string SlidingCell(const std::string& rest) {
  const std::string urdf = (TestFolder() / "slide.urdf").string();
  std::ofstream(urdf)
      << "<robot name='r'><link name='base'><visual><origin xyz='6.4 0 0'/><geometry>"
         "<box size='1 1 1'/></geometry></visual></link><link name='box'><visual><geometry>"
         "<box size='0.1 0.1 0.1'/></geometry></visual></link><joint name='s' type='prismatic'>"
         "<parent link='base'/><child link='box'/><axis xyz='1 0 0'/>"
         "<limit lower='-1' upper='1'/></joint></robot>";
  return "name: x\nrobot: {urdf: " + urdf +
         ", images: drawn, joints: [{name: s}]}\nviews:\n"
         "  - {name: a, image_size: [64, 48], mask_size: [64, 48]}\n"
         "  - {name: b, image_size: [64, 48], mask_size: [64, 48]}\n"
         "  - {name: c, image_size: [64, 48], mask_size: [64, 48]}\n" +
         rest;
}

// By what x of the robot's base each of the three views ends, metres; the robot is in all of them
// for an x of more than 1.1.
std::string PartialViewsOf(const std::vector<double>& ends, const std::string& rest = "") {
  const auto cell = Load(SlidingCell(rest));
  if (!cell.ok()) return std::string(cell.status().message());
  const auto drawn = DrawnCellOf(*cell);
  Calibration calibration;
  std::vector<MaskSize> sizes;
  for (const double end : ends) {
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.translation() = Eigen::Vector3d(6.4 - end, 0, 8);
    calibration.cameras.emplace_back(
        CameraIntrinsics{.width = 64, .height = 48, .fx = 40, .fy = 40, .cx = 31.5, .cy = 23.5},
        pose);
    sizes.push_back({64, 48});
  }
  const std::vector<std::string> moving = {"s"};
  const auto robot = DrawnRobotOf(**drawn, moving, {}, calibration, sizes, 0);
  if (!robot.ok()) return std::string(robot.status().message());
  return PartialViews(*cell, *robot, (*drawn)->forbidden);
}

TEST(PartialViews, ViewThatShowsAPartOfADrawnRobotIsNamedWithShareAndMend) {
  const std::string said = PartialViewsOf({6.4, 5, 0.3});
  EXPECT_THAT(said, AllOf(HasSubstr("view 'c' shows only a part of the robot at "),
                          HasSubstr("shown by at most 2 of 3 views"),
                          HasSubstr("move the camera, or state 'policy: {min_views: 1}'")));
  double share = 0;
  ASSERT_EQ(std::sscanf(said.c_str() + said.find("at "), "at %lf %%", &share), 1) << said;
  // The box is cut from 0.05 m before the end on, and a pixel of 0.2 m earlier: of 2 m.
  EXPECT_GT(share, 35);
  EXPECT_LT(share, 55);
}

TEST(PartialViews, SeveralViewsAreNamedInOneSentence) {
  EXPECT_THAT(PartialViewsOf({6.4, 0, 0.3}),
              AllOf(HasSubstr("views 'b', 'c' show only a part of the robot at "),
                    HasSubstr("shown by at most 1 of 3 views"), HasSubstr("move the cameras")));
  EXPECT_THAT(PartialViewsOf({0, 0, 0.3}),
              AllOf(HasSubstr("at most 0 of 3 views"), Not(HasSubstr("min_views"))));
}

TEST(PartialViews, ViewsThatHoldAllThatMovesAreNotNamed) {
  EXPECT_EQ(PartialViewsOf({6.4, 5, 4}), "");
}

TEST(PartialViews, ForbiddenJointValuesAndAStatedMinViewsCount) {
  EXPECT_EQ(PartialViewsOf({6.4, 5, 0.3}, "policy: {min_views: 1}\n"), "");
  EXPECT_NE(PartialViewsOf({6.4, 5, 0.3}, "policy: {min_views: 2}\n"), "");
  EXPECT_EQ(PartialViewsOf({6.4, 5, 0.3},
                           "capture: {forbidden_regions: [{name: r, joints: {s: [-0.3, 1]}}]}\n"),
            "");
}

TEST(MisplacedViews, SuspectImagesDoNotCount) {
  std::string text = SlidingCell("grid: {steps: {s: 16}}\n");
  text.erase(text.find("images: drawn, "), std::string("images: drawn, ").size());
  const auto cell = Load(text);
  ASSERT_TRUE(cell.ok()) << cell.status();
  const auto database = *Database::Create(FreshFolder() / "db", DescriptionOf(*cell));
  Eigen::Isometry3d near = Eigen::Isometry3d::Identity();
  near.translation().z() = 1;
  const CameraModel camera({.width = 64, .height = 48, .fx = 40, .fy = 40, .cx = 31.5, .cy = 23.5},
                           near);
  storage::v1::Calibration calibration;
  for (size_t view = 0; view < cell->views.size(); ++view) {
    *calibration.add_cameras() = MessageOf(camera);
  }
  ASSERT_TRUE(database->SetCalibration(calibration, "test").ok());
  const auto robot = ExpectedRobotOf(*cell, *database, database->mask_sizes(), "");
  ASSERT_TRUE(robot.ok() && *robot);
  // Those of even numbers, each the first of an eighth of the grid, show the box on the other side.
  auto writer = *database->Write("test");
  for (ConfigurationNumber number = 0; number < cell->grid.size(); ++number) {
    const double at = cell->grid.At(number)[0];
    const bool suspect = number % 2 == 0;
    RobotImage image;
    image.number = number;
    image.masks = (*robot)->Touched(std::vector<double>{suspect ? -at : at});
    image.commanded = image.measured = {at};
    image.captured = absl::FromUnixSeconds(suspect ? 150 : 250);
    EXPECT_TRUE(writer.Put(image).ok());
  }
  EXPECT_TRUE(writer.Commit().ok());
  EXPECT_THAT(*MisplacedViews(*cell, *database), HasSubstr("views 'a', 'b', 'c': the robot"));
  storage::v1::CaptureHistory history;
  storage::v1::SuspectSpan& span = *history.add_suspects();
  span.mutable_after()->set_seconds(100);
  span.mutable_until()->set_seconds(200);
  ASSERT_TRUE(database->SetCaptureHistory(history).ok());
  EXPECT_EQ(*MisplacedViews(*cell, *database), "");
}

}  // namespace
}  // namespace silhouette
