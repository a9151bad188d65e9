// SPDX-License-Identifier: Apache-2.0
// Lenses written for mrcal, and camera files of other programs.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

extern "C" {
#include <mrcal/mrcal.h>
}

#include <cmath>
#include <fstream>
#include <numbers>
#include <random>
#include <utility>

#include "calib/files/foreign_camera_file.h"
#include "calib/intrinsics/solve_lenses.h"
#include "tests/calib/intrinsics/synthetic_boards.h"
#include "tests/test_folder.h"

namespace silhouette {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;

SolvedCamera Solved(const CameraModel& camera) {
  const CameraIntrinsics& k = camera.intrinsics();
  SolvedCamera solved{.name = "left",
                      .width = k.width,
                      .height = k.height,
                      .lens_model = "LENSMODEL_OPENCV8",
                      .intrinsics = {k.fx, k.fy, k.cx, k.cy},
                      .camera_from_reference = camera.camera_from_world()};
  solved.intrinsics.insert(solved.intrinsics.end(), k.distortion.begin(), k.distortion.end());
  return solved;
}

TEST(LensFile, ComesBackToTheLastPartOfAPixel) {
  const CameraModel camera = CamerasOnAnArc(3)[2];
  const auto read = CameraFromForeignText(LensFileText(Solved(camera)), "left.cameramodel");
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->format, "mrcal");
  std::mt19937 random(31);
  std::uniform_real_distribution<double> unit(-1, 1);
  for (int i = 0; i < 200; ++i) {
    const Eigen::Vector3d point = 0.5 * Eigen::Vector3d(unit(random), unit(random), unit(random));
    EXPECT_LT((*camera.Project(point) - *read->camera.Project(point)).norm(), 1e-9);
  }
}

TEST(LensFile, IsReadByMrcal) {
  const CameraModel camera = CamerasOnAnArc(3)[2];
  SolvedCamera solved = Solved(camera);
  solved.known = LensRegion{.contour = {{0, 0}, {900.5, 0}, {0, 800}, {0, 0}}, .sigma = 1.9};
  const std::string path = FreshFolder() / "left.cameramodel";
  std::ofstream(path) << LensFileText(solved);
  mrcal_cameramodel_t* model = mrcal_read_cameramodel_file(path.c_str());
  ASSERT_NE(model, nullptr);
  EXPECT_EQ(model->lensmodel.type, MRCAL_LENSMODEL_OPENCV8);
  EXPECT_EQ(model->imagersize[0], 1280u);
  EXPECT_EQ(model->imagersize[1], 960u);
  for (size_t i = 0; i < 12; ++i) EXPECT_EQ(model->intrinsics[i], solved.intrinsics[i]);
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(model->rt_cam_ref[3 + i], camera.camera_from_world().translation()[i]);
  }
  mrcal_free_cameramodel(&model);
}

TEST(LensFile, HoldsAnyModelOfMrcal) {
  SolvedCamera solved = Solved(CamerasOnAnArc(1)[0]);
  solved.lens_model = "LENSMODEL_SPLINED_STEREOGRAPHIC_order=3_Nx=6_Ny=5_fov_x_deg=90";
  solved.intrinsics.assign(4 + 2 * 6 * 5, 0.25);
  const std::string text = LensFileText(solved);
  mrcal_cameramodel_t* model = mrcal_read_cameramodel_string(text.c_str(), 0);
  ASSERT_NE(model, nullptr);
  EXPECT_EQ(mrcal_lensmodel_num_params(&model->lensmodel), 64);
  EXPECT_EQ(model->intrinsics[63], 0.25);
  mrcal_free_cameramodel(&model);
}

constexpr char kOpenCv[] = R"(%YAML:1.0
---
calibration_time: "Mon Mar  2 10:11:12 2026"
image_width: 1280
image_height: 960
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 9.05e+02, 0., 645.5, 0., 9.02e+02, 470.25, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ -0.2, 0.08, 5e-4, -4e-4, -0.01 ]
)";

constexpr char kOpenCvXml[] = R"(<?xml version="1.0"?>
<opencv_storage>
<calibration_time>"Mon Mar  2 10:11:12 2026"</calibration_time>
<image_width>640</image_width>
<image_height>480</image_height>
<camera_matrix type_id="opencv-matrix">
  <rows>3</rows>
  <cols>3</cols>
  <dt>d</dt>
  <data>
    500. 0. 320. 0. 501. 240.5 0. 0. 1.</data></camera_matrix>
<distortion_coefficients type_id="opencv-matrix">
  <rows>1</rows>
  <cols>5</cols>
  <dt>d</dt>
  <data>
    -2.0e-01 8.0e-02 0. 0. 5.0e-04</data></distortion_coefficients>
</opencv_storage>)";

constexpr char kRos[] = R"(image_width: 640
image_height: 480
camera_name: narrow_stereo
camera_matrix:
  rows: 3
  cols: 3
  data: [500, 0, 320, 0, 501, 240, 0, 0, 1]
distortion_model: rational_polynomial
distortion_coefficients:
  rows: 1
  cols: 8
  data: [0.1, 0.2, 0.003, 0.004, 0.5, 0.6, 0.7, 0.8]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]
)";

constexpr char kKalibr[] = R"(cam0:
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [-0.28, 0.07, 0.0002, 1.7e-05]
  distortion_model: radtan
  intrinsics: [458.6, 457.3, 367.2, 248.4]
  resolution: [752, 480]
  rostopic: /cam0/image_raw
cam1:
  camera_model: pinhole
  distortion_coeffs: [0.1, 0.2, 0.3, 0.4]
  distortion_model: equidistant
  intrinsics: [457.6, 456.1, 379.9, 255.2]
  resolution: [752, 480]
)";

TEST(ForeignCameraFile, OfOpenCvIsRead) {
  const auto read = CameraFromForeignText(kOpenCv, "out.yml");
  ASSERT_TRUE(read.ok()) << read.status();
  const CameraIntrinsics& k = read->camera.intrinsics();
  EXPECT_EQ(read->format, "OpenCV");
  EXPECT_EQ(k.width, 1280);
  EXPECT_EQ(k.height, 960);
  EXPECT_EQ(k.fx, 905);
  EXPECT_EQ(k.fy, 902);
  EXPECT_EQ(k.cx, 645.5);
  EXPECT_EQ(k.cy, 470.25);
  EXPECT_THAT(k.distortion, ElementsAre(-0.2, 0.08, 5e-4, -4e-4, -0.01, 0, 0, 0));
}

TEST(ForeignCameraFile, OfOpenCvIsReadAsXml) {
  const auto read = CameraFromForeignText(kOpenCvXml, "out.xml");
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->format, "OpenCV");
  EXPECT_EQ(read->camera.intrinsics().width, 640);
  EXPECT_EQ(read->camera.intrinsics().cy, 240.5);
  EXPECT_THAT(read->camera.intrinsics().distortion, ElementsAre(-0.2, 0.08, 0, 0, 5e-4, 0, 0, 0));
  const std::string text = kOpenCvXml;
  for (size_t length = 5; length < text.size() - 2; ++length) {
    EXPECT_FALSE(CameraFromForeignText(text.substr(0, length), "out.xml").ok()) << length;
  }
}

TEST(ForeignCameraFile, OfRosIsReadInBothItsForms) {
  const auto read = CameraFromForeignText(kRos, "left.yaml");
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->format, "ROS");
  EXPECT_EQ(read->camera.intrinsics().fy, 501);
  EXPECT_THAT(read->camera.intrinsics().distortion,
              ElementsAre(0.1, 0.2, 0.003, 0.004, 0.5, 0.6, 0.7, 0.8));
  const auto message = CameraFromForeignText(
      "height: 480\nwidth: 640\ndistortion_model: plumb_bob\nD: [0.1, 0, 0, 0, 0]\n"
      "K: [500, 0, 320, 0, 501, 240, 0, 0, 1]\n",
      "info.yaml");
  ASSERT_TRUE(message.ok()) << message.status();
  EXPECT_EQ(message->camera.intrinsics().distortion[0], 0.1);
  EXPECT_EQ(message->camera.intrinsics().width, 640);
}

TEST(ForeignCameraFile, OfKalibrIsReadByTheCamerasName) {
  const auto read = CameraFromForeignText(kKalibr, "camchain.yaml", {.camera = "cam0"});
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->format, "Kalibr");
  EXPECT_EQ(read->camera.intrinsics().cx, 367.2);
  EXPECT_THAT(read->camera.intrinsics().distortion,
              ElementsAre(-0.28, 0.07, 0.0002, 1.7e-05, 0, 0, 0, 0));
}

TEST(ForeignCameraFile, OfEurocAndOlderOpenCvAreRead) {
  const auto euroc = CameraFromForeignText(
      "camera_model: pinhole\ndistortion_model: radial-tangential\n"
      "distortion_coefficients: [-0.28, 0.07, 0.0002, 1.7e-05]\n"
      "intrinsics: [458.6, 457.3, 367.2, 248.4]\nresolution: [752, 480]\nrate_hz: 20\n",
      "sensor.yaml");
  ASSERT_TRUE(euroc.ok()) << euroc.status();
  EXPECT_EQ(euroc->camera.intrinsics().distortion[1], 0.07);
  const auto older = CameraFromForeignText(
      "image_Width: 640\nimage_Height: 480\nCamera_Matrix: [535, 0, 320, 0, 536, 240, 0, 0, 1]\n"
      "Distortion_Coefficients: [-0.2, 0.1, 0, 0, 0]\n",
      "out_camera_data.yml");
  ASSERT_TRUE(older.ok()) << older.status();
  EXPECT_EQ(older->camera.intrinsics().fy, 536);
}

TEST(ForeignCameraFile, EachCameraOfAStereoPairIsRead) {
  const ForeignCameraOptions first = {.image_size = {{640, 480}}, .camera = "1"};
  const ForeignCameraOptions second = {.image_size = {{640, 480}}, .camera = "2"};
  const std::string matrices =
      "{rows: 3, cols: 3, dt: d, data: [535, 0, 320, 0, 536, 240, 0, 0, 1]}\n"
      "D1: !!opencv-matrix {rows: 1, cols: 5, dt: d, data: [-0.2, 0.1, 0, 0, 0]}\n"
      "D2: !!opencv-matrix {rows: 1, cols: 5, dt: d, data: [-0.3, 0.1, 0, 0, 0]}\n"
      "R: [1, 0, 0, 0, 1, 0, 0, 0, 1]\nT: [-0.1, 0, 0]\n";
  for (const std::string key : {"M", "K"}) {
    const std::string text = "%YAML:1.0\n---\n" + key + "2: [635, 0, 320, 0, 636, 240, 0, 0, 1]\n" +
                             key + "1: !!opencv-matrix " + matrices;
    const auto left = CameraFromForeignText(text, "intrinsics.yml", first);
    ASSERT_TRUE(left.ok()) << left.status();
    EXPECT_EQ(left->camera.intrinsics().fy, 536);
    EXPECT_EQ(left->camera.intrinsics().distortion[0], -0.2);
    const auto right = CameraFromForeignText(text, "intrinsics.yml", second);
    ASSERT_TRUE(right.ok()) << right.status();
    EXPECT_EQ(right->camera.intrinsics().fy, 636);
    EXPECT_EQ(right->camera.intrinsics().distortion[0], -0.3);
    EXPECT_THAT(std::string(CameraFromForeignText(text, "intrinsics.yml").status().message()),
                HasSubstr("say which camera is meant; there are '1' and '2' (--camera)"));
  }
}

TEST(ForeignCameraFile, NumbersOfDistortionAreNoCameras) {
  const auto read = CameraFromForeignText("fx: 535\nfy: 536\nk1: -0.2\nk2: 0.1\n", "camera.yaml");
  EXPECT_THAT(std::string(read.status().message()), HasSubstr("no camera is found in it"));
}

TEST(ForeignCameraFile, AMatrixOfBareNumbersIsRead) {
  const ForeignCameraOptions size = {.image_size = {{640, 480}}};
  const auto bare = CameraFromForeignText("535 0 320\n0 536 240\n0 0 1\n", "K.txt", size);
  ASSERT_TRUE(bare.ok()) << bare.status();
  EXPECT_EQ(bare->camera.intrinsics().fy, 536);
  const auto distorted = CameraFromForeignText(
      "[[535, 0, 320], [0, 536, 240], [0, 0, 1]]\n[-0.2, 0.1, 0, 0, 0]", "K.txt", size);
  ASSERT_TRUE(distorted.ok()) << distorted.status();
  EXPECT_EQ(distorted->camera.intrinsics().distortion[0], -0.2);
  EXPECT_FALSE(CameraFromForeignText("1 2 3\n", "K.txt", size).ok());
}

TEST(ForeignCameraFile, EquidistantLensIsConvertedAndSaysHowWell) {
  const auto read = CameraFromForeignText(kKalibr, "camchain.yaml", {.camera = "cam1"});
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_GT(read->converted, 0);
  EXPECT_LT(read->converted, 0.1);
}

TEST(ForeignCameraFile, FourCoefficientsOfOpenCvAreThoseOfAFisheyeLensIfSaid) {
  const std::string text = "461.6 0 362.7 0 460.2 248.1 0 0 1 -0.0033 0.0007 -0.0021 0.0002";
  const auto plain = CameraFromForeignText(text, "K.txt", {.image_size = {{752, 480}}});
  ASSERT_TRUE(plain.ok()) << plain.status();
  EXPECT_TRUE(plain->may_be_fisheye);
  EXPECT_EQ(plain->camera.intrinsics().distortion[2], -0.0021);
  const auto read =
      CameraFromForeignText(text, "K.txt", {.image_size = {{752, 480}}, .fisheye = true});
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_FALSE(read->may_be_fisheye);
  EXPECT_GT(read->converted, 0);
  // A ray at 40 degrees, by cv2.fisheye's formula.
  const double angle = 40 * std::numbers::pi / 180;
  const double square = angle * angle;
  const double bent =
      angle * (1 + square * (-0.0033 + square * (0.0007 + square * (-0.0021 + square * 0.0002))));
  const auto pixel = read->camera.Project({std::sin(angle), 0, std::cos(angle)});
  ASSERT_TRUE(pixel.has_value());
  EXPECT_NEAR(pixel->x(), 362.7 + 461.6 * bent, 0.1);
  for (const auto& [stated, camera] : {std::pair(kKalibr, "cam0"), std::pair(kRos, "")}) {
    const auto refused =
        CameraFromForeignText(stated, "c.yaml", {.camera = camera, .fisheye = true});
    EXPECT_THAT(std::string(refused.status().message()), HasSubstr("leave --fisheye out"));
  }
}

TEST(ForeignCameraFile, SaysWhatItDoesNotHold) {
  const auto refusal = [](std::string text, const ForeignCameraOptions& options = {},
                          const std::string& from = "", const std::string& to = "") {
    if (!from.empty()) text.replace(text.find(from), from.size(), to);
    const auto read = CameraFromForeignText(text, "c.yaml", options);
    EXPECT_EQ(read.status().code(), absl::StatusCode::kInvalidArgument);
    return std::string(read.status().message());
  };
  EXPECT_THAT(refusal(kKalibr, {.camera = "cam1"}, "equidistant", "fov"),
              AllOf(HasSubstr("c.yaml:12"), HasSubstr("'fov' is not held")));
  EXPECT_THAT(refusal(kKalibr),
              HasSubstr("say which camera is meant; there are 'cam0' and 'cam1'"));
  EXPECT_THAT(refusal(kRos, {}, "rational_polynomial", "equidistant"),
              HasSubstr("an equidistant lens has 4 coefficients, not 8"));
  EXPECT_THAT(refusal(kOpenCv, {}, "image_width: 1280", ""), HasSubstr("images' size"));
  EXPECT_THAT(refusal(kOpenCv, {.image_size = {{640, 480}}}), HasSubstr("not of 640x480"));
  EXPECT_THAT(refusal(kOpenCv, {}, "[ -0.2,", "[ "), HasSubstr("c.yaml:"));
  EXPECT_THAT(refusal(kRos, {}, "[500, 0,", "[500, 1.5,"), HasSubstr("no skew"));
  EXPECT_THAT(refusal(kRos, {}, "[500, 0,", "[-500, 0,"), HasSubstr("focal length"));
  EXPECT_THAT(refusal("a: 1\n"), HasSubstr("no camera is found in it"));
  EXPECT_THAT(refusal(kRos, {}, "rows: 1", "rows: 1073741824"), HasSubstr("does not belong here"));
}

}  // namespace
}  // namespace silhouette
