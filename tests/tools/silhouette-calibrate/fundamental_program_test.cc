// SPDX-License-Identifier: Apache-2.0
// silhouette-calibrate fundamental as a user runs it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <numbers>
#include <opencv2/imgcodecs.hpp>

#include "calib/boards/sighting_file.h"
#include "calib/files/calibration_message.h"
#include "calib/files/calibration_session_file.h"
#include "calib/files/camera_file.h"
#include "calib/fundamental/epipolar_geometry.h"
#include "tests/calib/fundamental/seen_cell.h"
#include "tests/folders.h"
#include "tests/shell.h"

namespace silhouette {
namespace {

using Json = nlohmann::json;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

class FundamentalProgram : public testing::Test {
 protected:
  void WriteCell(double k1, size_t frames = 40) {
    cameras_ = CellCameras(k1);
    board_ = CarriedBoard(cameras_, frames, 3);
    WriteFile(shell_.folder() / "corners.csv", SightingFileText(board_.sightings));
    for (const NamedCamera& camera : cameras_) {
      WriteFile(shell_.folder() / "cameras" / CameraFileName(camera.view),
                CameraFileText(camera.model, camera.view));
    }
  }
  // What these cameras see of five tags on the floor.
  void WriteFixedTags(const std::vector<NamedCamera>& cameras) const {
    Chance chance(1);
    std::vector<TagSighting> sightings;
    for (int tag = 0; tag < 5; ++tag) {
      const Board board({.name = "floor", .tag_size = 0.15, .first_id = tag});
      Eigen::Isometry3d pose(Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitX()));
      pose.translation() = Eigen::Vector3d(0.5 * tag - 1, 0.3 * (tag % 3) - 0.4, 0);
      for (const NamedCamera& camera : cameras) {
        const auto seen = ProjectTags(camera, "1", board, pose,
                                      {.sigma = 0.05, .least_size = 8, .most_tilt = 1.5}, chance);
        sightings.insert(sightings.end(), seen.begin(), seen.end());
      }
    }
    WriteFile(shell_.folder() / "then.csv", SightingFileText(sightings));
  }
  Ended Run(const std::string& arguments) const {
    return shell_.Run(ProgramFolder() + "/silhouette-calibrate fundamental " + arguments);
  }

  Shell shell_;
  std::vector<NamedCamera> cameras_;
  BoardFrames board_;
};

constexpr char kWeak[] = "--corners corners.csv --image-size 640x480 --mask-size 64x64 ";

TEST_F(FundamentalProgram, WritesMatricesThatTheDatabaseReads) {
  WriteCell(0);
  const Ended ended = Run(std::string(kWeak) + "--out matrices.yaml --format json");
  ASSERT_EQ(ended.exit_code, 0) << ended.err;
  const Json told = Json::parse(ended.out);
  ASSERT_EQ(told["pairs"].size(), 6u);
  for (const Json& pair : told["pairs"]) {
    if (pair["corners"] < 1000) continue;
    EXPECT_LT(pair["held_out"]["rms_px"], 0.06);
    EXPECT_LT(pair["margin"], 0.1);
  }
  storage::v1::CellDescription cell;
  for (const NamedCamera& camera : cameras_) cell.add_views()->set_name(camera.view);
  const auto read =
      MatricesFromText(ContentOf(shell_.folder() / "matrices.yaml"), "matrices.yaml", cell);
  ASSERT_TRUE(read.ok()) << read.status();
  const auto calibration = CalibrationFrom(*read);
  ASSERT_TRUE(calibration.ok());
  EXPECT_GE(calibration->fundamental_matrices.size(), 3u);
  const Eigen::Vector3d point(0.2, 0.3, 1);
  for (const FundamentalMatrix& matrix : calibration->fundamental_matrices) {
    const auto pixel = [&](int view) {
      return *cameras_[static_cast<size_t>(view)].model.ScaledTo(64, 64).Project(point);
    };
    EXPECT_LT(DistanceBetween(matrix.f, pixel(matrix.view_a), pixel(matrix.view_b)).in_b, 0.05);
  }
}

TEST_F(FundamentalProgram, SizesThatDetectWroteNeedNotBeStatedAndAreNotContradicted) {
  WriteCell(0);
  for (TagSighting& seen : board_.sightings) seen.image = {640, 480};
  WriteFile(shell_.folder() / "corners.csv", SightingFileText(board_.sightings));
  const Ended ended = Run("--corners corners.csv --mask-size 64x64 --out matrices.yaml");
  EXPECT_EQ(ended.exit_code, 0) << ended.err;
  const Ended stated = Run(std::string(kWeak) + "--out stated.yaml");
  EXPECT_EQ(stated.exit_code, 0) << stated.err;
  EXPECT_EQ(ContentOf(shell_.folder() / "matrices.yaml"),
            ContentOf(shell_.folder() / "stated.yaml"));
  const Ended other = Run("--corners corners.csv --image-size 1280x960 --mask-size 64x64");
  EXPECT_EQ(other.exit_code, 2);
  EXPECT_THAT(other.err, HasSubstr("the stated image size is 1280x960, but its corners were found "
                                   "in images of 640x480"));
}

TEST_F(FundamentalProgram, CameraModelsAreToldFromTheirCorners) {
  WriteCell(-0.2);
  const Ended ended =
      Run("--cameras cameras --corners corners.csv --mask-size 64x64 --format json");
  ASSERT_EQ(ended.exit_code, 0) << ended.err;
  const Json told = Json::parse(ended.out);
  for (const Json& pair : told["pairs"]) {
    EXPECT_GT(pair["bow"]["curve_px"], 1);
    EXPECT_GT(pair["bow"]["margin"], 0.25);
    EXPECT_THAT(pair["refusal"], HasSubstr("import the camera models themselves"));
    if (pair["corners"] == 0) continue;
    EXPECT_LT(pair["distances"]["rms_px"], 0.06);
  }
}

TEST_F(FundamentalProgram, WritesNoMatrixThatDistortionMakesWrong) {
  WriteCell(-0.2);
  for (const std::string source : {"--cameras cameras --mask-size 64x64 ", kWeak}) {
    const Ended ended = Run(source + "--out matrices.yaml");
    EXPECT_EQ(ended.exit_code, 1);
    EXPECT_THAT(ended.out, HasSubstr("camera models"));
    EXPECT_THAT(ended.err, HasSubstr("'matrices.yaml' is not written"));
    EXPECT_FALSE(std::filesystem::exists(shell_.folder() / "matrices.yaml"));
  }
  EXPECT_EQ(Run("--cameras cameras --mask-size 64x64 --undistorted-images --out m.yaml").exit_code,
            0);
}

constexpr char kFixed[] =
    "--cameras cameras --mask-size 64x64 --calibration calibration.yaml --fixed-tags then.csv";

TEST_F(FundamentalProgram, FixedTagsOfACameraThatMovedAreRefused) {
  WriteCell(-0.2);
  WriteFixedTags(cameras_);
  const Ended still = Run(kFixed);
  EXPECT_EQ(still.exit_code, 0) << still.err;
  EXPECT_EQ(still.err, "");
  EXPECT_THAT(ContentOf(shell_.folder() / "calibration.yaml"), HasSubstr("fixed_tags"));
  std::filesystem::remove(shell_.folder() / "calibration.yaml");

  // Half a degree: 4.6 px, across the lines.
  const CameraModel& east = cameras_[1].model;
  const Eigen::Isometry3d turn(
      Eigen::AngleAxisd(0.5 * std::numbers::pi / 180, Eigen::Vector3d::UnitX()));
  cameras_[1].model = CameraModel(east.intrinsics(), turn * east.camera_from_world());
  WriteFixedTags(cameras_);
  const Ended moved = Run(kFixed);
  EXPECT_EQ(moved.exit_code, 2);
  EXPECT_THAT(moved.err, HasSubstr("a camera moved after it was calibrated"));
  EXPECT_THAT(moved.err, HasSubstr("'east' and 'north' by "));
  EXPECT_THAT(moved.err, HasSubstr("the limit is 0.2 mask px; calibrate again"));
  EXPECT_THAT(moved.err, Not(HasSubstr("'north' and 'south'")));
  EXPECT_FALSE(std::filesystem::exists(shell_.folder() / "calibration.yaml"));
}

TEST_F(FundamentalProgram, WarnsOfViewsThatShareNoFixedTagWithAnother) {
  WriteCell(0);
  WriteFixedTags({cameras_[0], cameras_[1]});
  const Ended ended = Run(kFixed);
  EXPECT_EQ(ended.exit_code, 0) << ended.err;
  EXPECT_THAT(ended.err, AllOf(HasSubstr("view 'south' shares no fixed tag with another"),
                               HasSubstr("view 'west' shares no fixed tag with another"),
                               Not(HasSubstr("'north'")), Not(HasSubstr("'east'"))));
}

TEST_F(FundamentalProgram, DrawsEveryPair) {
  WriteCell(0, 12);
  cv::imwrite(shell_.folder() / "north.png", cv::Mat(480, 640, CV_8UC3, cv::Scalar(90, 120, 60)));
  const Ended ended =
      Run("--cameras cameras --corners corners.csv --mask-size 64x64 --draw bands "
          "--images . --frame 0003");
  ASSERT_EQ(ended.exit_code, 0) << ended.err;
  const cv::Mat picture = cv::imread(shell_.folder() / "bands" / "bands_east_north.png");
  ASSERT_FALSE(picture.empty());
  EXPECT_GT(picture.cols, 1100);
  EXPECT_GT(picture.rows, 800);
}

TEST_F(FundamentalProgram, SaysWhatIsMissing) {
  WriteCell(0, 5);
  const auto expect = [&](const std::string& arguments, const std::string& said) {
    const Ended ended = Run(arguments);
    EXPECT_EQ(ended.exit_code, 2) << arguments;
    EXPECT_THAT(ended.err, HasSubstr(said));
  };
  expect("", "give --corners");
  expect("--corners corners.csv --mask-size 64x64", "how large the images of view");
  expect("--corners corners.csv --image-size 640x480", "how large the masks of view");
  expect("--corners corners.csv --image-size 640 --mask-size 64x64", "is not WIDTHxHEIGHT");
  expect("--corners nothing.csv --image-size 0x0", "--image-size: size '0x0' is not WIDTHxHEIGHT");
  expect("--corners corners.csv --image-size 320x240 --mask-size 64x64", "sizes are mixed");
  expect("--corners nothing.csv", "nothing.csv");
  expect("--cameras nowhere --mask-size 64x64", "nowhere");
  std::filesystem::rename(shell_.folder() / "cameras" / "east.cameramodel",
                          shell_.folder() / "cameras" / "window.cameramodel");
  expect("--cameras cameras --corners corners.csv --mask-size 64x64", "a view 'east' that is not");
}

}  // namespace
}  // namespace silhouette
