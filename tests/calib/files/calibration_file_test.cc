// SPDX-License-Identifier: Apache-2.0
// Camera models and fundamental matrices as files, and as stored.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <numbers>
#include <random>

#include "absl/strings/str_replace.h"
#include "calib/files/calibration_message.h"
#include "calib/files/calibration_session_file.h"
#include "calib/files/camera_file.h"
#include "tests/random.h"

namespace silhouette {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::StartsWith;

// As mrcal writes it, with keys that are of no use here.
constexpr char kFile[] = R"(# generated on 2026-03-01 10:11:12
{
    'lensmodel':  'LENSMODEL_OPENCV8',

    # intrinsics are fx,fy,cx,cy,distortion0,distortion1,....
    'intrinsics': [ 1761.181055, 1761.250444, 1965.706996, 1087.518797, -0.01266096516, 0.03590794372, -0.0002547045941, 0.0005275929652, 0.01968883397, 0.01482863541, -0.0562239888, 0.0500223357,],

    'valid_intrinsics_region': [
    [ 501, 0 ],
    [ 501, 871 ],
    ],

    # extrinsics are rt_fromref
    'extrinsics': [ 2e-2, -3.0e-1, 1, 0., .5, -7,],

    'imagersize': ( 4000, 2200,),
    'icam_intrinsics': 0,
    'optimization_inputs': b'P)h>@6aWAK2mk;8Fgp&D{|c%00=uI#,x',
}
)";

storage::v1::CellDescription ThreeViews() {
  storage::v1::CellDescription cell;
  for (const char* name : {"top", "le\"ft: #1", "front"}) cell.add_views()->set_name(name);
  return cell;
}

TEST(CameraFile, OfMrcalIsRead) {
  const auto camera = StoredCameraFromText(kFile, "top.cameramodel");
  ASSERT_TRUE(camera.ok()) << camera.status();
  EXPECT_EQ(camera->image_width(), 4000);
  EXPECT_EQ(camera->image_height(), 2200);
  EXPECT_EQ(camera->fx(), 1761.181055);
  EXPECT_EQ(camera->fy(), 1761.250444);
  EXPECT_EQ(camera->cx(), 1965.706996);
  EXPECT_EQ(camera->cy(), 1087.518797);
  EXPECT_THAT(camera->distortion(),
              ElementsAre(-0.01266096516, 0.03590794372, -0.0002547045941, 0.0005275929652,
                          0.01968883397, 0.01482863541, -0.0562239888, 0.0500223357));
  EXPECT_THAT(camera->rotation(), ElementsAre(0.02, -0.3, 1));
  EXPECT_THAT(camera->translation(), ElementsAre(0, 0.5, -7));
}

TEST(CameraFile, PoseHasTheNewerNameOfMrcalToo) {
  const auto camera = StoredCameraFromText(
      absl::StrReplaceAll(kFile, {{"'extrinsics'", "'rt_cam_ref'"}}), "top.cameramodel");
  ASSERT_TRUE(camera.ok()) << camera.status();
  EXPECT_THAT(camera->rotation(), ElementsAre(0.02, -0.3, 1));
  EXPECT_THAT(camera->translation(), ElementsAre(0, 0.5, -7));
}

TEST(CameraFile, SaysWhatIsWrongAndWhere) {
  const auto refusal = [](const std::string& from, const std::string& to) {
    const auto camera =
        StoredCameraFromText(absl::StrReplaceAll(kFile, {{from, to}}), "top.cameramodel");
    EXPECT_EQ(camera.status().code(), absl::StatusCode::kInvalidArgument);
    return std::string(camera.status().message());
  };
  const std::string splined = refusal("OPENCV8", "SPLINED_STEREOGRAPHIC_order=3");
  EXPECT_THAT(splined, StartsWith("top.cameramodel:3: lensmodel: 'LENSMODEL_SPLINED_STEREO"));
  EXPECT_THAT(splined, HasSubstr("is not supported; use LENSMODEL_PINHOLE"));
  EXPECT_THAT(refusal("OPENCV8", "OPENCV5"), StartsWith("top.cameramodel:6: intrinsics: "));
  EXPECT_THAT(refusal("'extrinsics'", "'extrinsic'"), HasSubstr("'extrinsics'"));
  EXPECT_THAT(refusal(" 0., .5, -7", " 0., -7"), StartsWith("top.cameramodel:14: extrinsics: "));
  EXPECT_THAT(refusal("1761.181055", "wide"), StartsWith("top.cameramodel:6: intrinsics"));
  EXPECT_THAT(refusal("1761.181055", ".inf"), HasSubstr("a number is expected"));
  EXPECT_THAT(refusal("( 4000, 2200,)", "[ 4000 ]"), StartsWith("top.cameramodel:16: imagersize"));
  EXPECT_THAT(refusal("{\n", "\n"), StartsWith("top.cameramodel:"));
  EXPECT_THAT(StoredCameraFromText("", "empty.cameramodel").status().message(),
              HasSubstr("empty.cameramodel: the file is empty"));
}

TEST(CameraFile, StatesWhereItsLensIsKnown) {
  const CameraModel camera({.width = 640, .height = 480, .fx = 600, .fy = 600});
  const LensRegion triangle{.contour = {{-0.5, 1.0 / 3}, {600, 3}, {20, 400}, {-0.5, 1.0 / 3}}};
  LensRegion ours = triangle;
  ours.sigma = 0.1;
  for (const LensRegion& known : {triangle, ours, LensRegion()}) {
    const auto read = LensRegionFromText(CameraFileText(camera, "top", known), "top.cameramodel");
    ASSERT_TRUE(read.ok() && read->has_value()) << read.status();
    EXPECT_EQ((*read)->contour, known.contour);
    EXPECT_EQ((*read)->sigma, known.sigma);
  }
  const auto none = LensRegionFromText(CameraFileText(camera, "top"), "top.cameramodel");
  ASSERT_TRUE(none.ok()) << none.status();
  EXPECT_FALSE(none->has_value());
}

TEST(CameraFile, ARegionThatIsNoClosedLineIsRefusedWithItsFile) {
  const auto refusal = [](const std::string& region) {
    const auto read =
        LensRegionFromText(absl::StrReplaceAll(kFile, {{"[ 501, 0 ],\n    [ 501, 871 ],", region}}),
                           "top.cameramodel");
    EXPECT_EQ(read.status().code(), absl::StatusCode::kInvalidArgument) << region;
    return std::string(read.status().message());
  };
  for (const char* const open :
       {"[1, 2], [3, 4]", "[1, 2], [3, 4], [1, 2]", "[0, 0], [9, 0], [9, 9], [0, 9], [0, 1]"}) {
    EXPECT_THAT(refusal(open), AllOf(StartsWith("top.cameramodel:"),
                                     HasSubstr("valid_intrinsics_region: is no closed line")));
  }
  for (const char* const wrong : {"1, 2", "[1], [2], [3], [1]", "[.nan, 0], [1, 0], [1, 1], [0, 0]",
                                  "[a, 0], [1, 0], [1, 1], [a, 0]"}) {
    EXPECT_THAT(refusal(wrong), StartsWith("top.cameramodel:")) << wrong;
  }
}

TEST(CameraFile, GivesBackEveryBitOfWhatWasWritten) {
  Random random;
  std::normal_distribution<double> normal;
  for (const int parameters : {0, 4, 5, 8}) {
    storage::v1::CameraModel camera;
    camera.set_image_width(640);
    camera.set_image_height(480);
    camera.set_fx(500 * std::exp(normal(random)));
    camera.set_fy(500 * std::exp(normal(random)));
    camera.set_cx(320 + normal(random));
    camera.set_cy(240 + normal(random));
    for (int i = 0; i < parameters; ++i) camera.add_distortion(normal(random) * 1e-5);
    for (int i = 0; i < 3; ++i) camera.add_rotation(normal(random));
    for (int i = 0; i < 3; ++i) camera.add_translation(normal(random));
    const auto read = StoredCameraFromText(CameraFileText(camera, "top"), "top.cameramodel");
    ASSERT_TRUE(read.ok()) << read.status();
    EXPECT_EQ(read->SerializeAsString(), camera.SerializeAsString());
  }
}

TEST(CameraFile, IsNamedAfterItsView) {
  EXPECT_EQ(CameraFileName("top"), "top.cameramodel");
  EXPECT_EQ(CameraFileName("cell 1, left"), "cell 1, left.cameramodel");
  EXPECT_EQ(CameraFileName("../etc/x%"), "..%2fetc%2fx%25.cameramodel");
}

TEST(CameraMessage, SpeaksOfTheSameCamera) {
  Random random;
  std::normal_distribution<double> normal;
  // Turns of nothing and of half a circle are where rotation vectors are awkward.
  for (const double angle : {0.0, 1e-9, 0.7, 2.5, std::numbers::pi - 1e-9, std::numbers::pi}) {
    const Eigen::Vector3d axis =
        Eigen::Vector3d(normal(random), normal(random), normal(random)).normalized();
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.linear() = Eigen::AngleAxisd(angle, axis).toRotationMatrix();
    pose.translation() = Eigen::Vector3d(0.1, -2, 3);
    const CameraModel camera({.width = 640,
                              .height = 480,
                              .fx = 600,
                              .fy = 601,
                              .cx = 319,
                              .cy = 241,
                              .distortion = {-0.1, 0.02, 1e-3, -1e-3, 0.01, 0.1, 0.01, 1e-3}},
                             pose);
    const auto back = CameraFrom(MessageOf(camera));
    ASSERT_TRUE(back.ok()) << back.status();
    EXPECT_EQ(back->intrinsics().width, 640);
    EXPECT_EQ(back->intrinsics().fy, 601);
    EXPECT_EQ(back->intrinsics().distortion, camera.intrinsics().distortion);
    EXPECT_TRUE(back->camera_from_world().isApprox(pose, 1e-14)) << angle;
  }
}

TEST(CameraMessage, ThatIsNoCameraIsRefused) {
  storage::v1::CameraModel message = *StoredCameraFromText(kFile, "top.cameramodel");
  message.set_fx(0);
  EXPECT_EQ(CameraFrom(message).status().code(), absl::StatusCode::kInvalidArgument);
  message.set_fx(1);
  EXPECT_TRUE(CameraFrom(message).ok());
  message.mutable_rotation()->RemoveLast();
  EXPECT_EQ(CameraFrom(message).status().code(), absl::StatusCode::kInvalidArgument);
  storage::v1::Calibration calibration;
  *calibration.add_cameras() = message;
  EXPECT_THAT(CalibrationFrom(calibration).status().message(), HasSubstr("camera 1: "));
}

constexpr char kMatrices[] = R"(
- view_a: top
  view_b: front
  F: [[0, 0, 0.5], [0, 0, -1], [0.25, 1, 3]]
- {view_a: front, view_b: 'le"ft: #1', F: [[1, 2, 3], [4, 5, 6], [7, 8, 9]]}
)";

TEST(MatrixFile, IsRead) {
  const auto message = MatricesFromText(kMatrices, "f.yaml", ThreeViews());
  ASSERT_TRUE(message.ok()) << message.status();
  const auto calibration = CalibrationFrom(*message);
  ASSERT_TRUE(calibration.ok()) << calibration.status();
  EXPECT_TRUE(calibration->cameras.empty());
  ASSERT_EQ(calibration->fundamental_matrices.size(), 2u);
  const FundamentalMatrix& first = calibration->fundamental_matrices[0];
  EXPECT_EQ(first.view_a, 0);
  EXPECT_EQ(first.view_b, 2);
  Eigen::Matrix3d expected;
  expected << 0, 0, 0.5, 0, 0, -1, 0.25, 1, 3;
  EXPECT_EQ(first.f, expected);
  EXPECT_EQ(calibration->fundamental_matrices[1].view_b, 1);
}

TEST(MatrixFile, SaysWhatIsWrongAndWhere) {
  const auto refusal = [](const std::string& from, const std::string& to) {
    const auto matrices =
        MatricesFromText(absl::StrReplaceAll(kMatrices, {{from, to}}), "f.yaml", ThreeViews());
    EXPECT_EQ(matrices.status().code(), absl::StatusCode::kInvalidArgument);
    return std::string(matrices.status().message());
  };
  const std::string unknown = refusal("view_a: top", "view_a: tpo");
  EXPECT_THAT(unknown, StartsWith("f.yaml:2: "));
  EXPECT_THAT(unknown, HasSubstr("there is no view 'tpo'; the views are 'top', "));
  EXPECT_THAT(refusal("view_a: top", "view_a: front"), HasSubstr("are the same view"));
  EXPECT_THAT(refusal("'le\"ft: #1'", "top"), StartsWith("f.yaml:5: "));
  EXPECT_THAT(refusal("'le\"ft: #1'", "top"), HasSubstr("have a matrix already"));
  EXPECT_THAT(refusal("[0, 0, -1], ", ""), StartsWith("f.yaml:4: "));
  EXPECT_THAT(refusal("-1]", "x]"), StartsWith("f.yaml:4: "));
  EXPECT_THAT(refusal("  F: [[0", "  G: [[0"), HasSubstr("'F'"));
  EXPECT_THAT(refusal("-1],", "-1"), StartsWith("f.yaml:"));
  EXPECT_THAT(MatricesFromText("[]", "f.yaml", ThreeViews()).status().message(),
              HasSubstr("there is no fundamental matrix"));
}

TEST(MatrixFile, GivesBackEveryBitOfWhatWasWritten) {
  Random random;
  std::normal_distribution<double> normal;
  storage::v1::Calibration calibration;
  for (const auto& [a, b] : {std::pair(0, 1), std::pair(2, 1)}) {
    storage::v1::FundamentalMatrix& matrix = *calibration.add_fundamental_matrices();
    matrix.set_view_a(a);
    matrix.set_view_b(b);
    for (int i = 0; i < 9; ++i) matrix.add_f(normal(random) * std::exp(9 * normal(random)));
  }
  const auto read =
      MatricesFromText(MatrixFileText(calibration, ThreeViews()), "f.yaml", ThreeViews());
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->SerializeAsString(), calibration.SerializeAsString());
}

storage::v1::CellDescription TwoViews() {
  storage::v1::CellDescription cell;
  cell.add_views()->set_name("top");
  cell.add_views()->set_name("left: 2");
  return cell;
}

CalibrationSession Session() {
  CalibrationSession session;
  storage::v1::FundamentalMatrix& matrix = *session.calibration.add_fundamental_matrices();
  matrix.set_view_b(1);
  for (int i = 0; i < 9; ++i) matrix.add_f(0.1 * i + 1.0 / 3);
  storage::v1::CalibrationRecord& record = *session.calibration.mutable_record();
  record.set_time("2026-11-21T21:00:00Z");
  record.set_program("silhouette-calibrate fundamental \"x\"");
  storage::v1::CalibrationFigure& figure = *record.add_figures();
  figure.set_name("corner_rms");
  figure.set_of("top");
  figure.set_value(0.1 + 0.2);
  figure.set_unit("px");
  record.add_warnings("a colon: here");
  storage::v1::FixedTag& tag = *record.add_fixed_tags();
  tag.set_view(1);
  tag.set_family("tagStandard41h12");
  tag.set_tag(7);
  tag.set_sigma(0.02);
  for (int i = 0; i < 8; ++i) tag.add_corners(10.0 / 3 * i);
  return session;
}

TEST(CalibrationSessionFile, ReadsWhatItWrites) {
  for (const bool cameras : {false, true}) {
    CalibrationSession session = Session();
    if (cameras) session.camera_files = {"top.cameramodel", "sub/left%3a 2.cameramodel"};
    const std::string text = SessionFileText(session, TwoViews());
    EXPECT_TRUE(IsSessionFile(text));
    const auto read = SessionFromText(text, "calibration.yaml", TwoViews());
    ASSERT_TRUE(read.ok()) << read.status() << text;
    EXPECT_EQ(read->camera_files, session.camera_files);
    EXPECT_EQ(read->calibration.SerializeAsString(), session.calibration.SerializeAsString());
  }
}

TEST(CalibrationSessionFile, IsNoListOfMatrices) {
  EXPECT_FALSE(IsSessionFile("- {view_a: top, view_b: left, F: []}\n"));
  EXPECT_FALSE(IsSessionFile("a: [b"));
}

TEST(CalibrationSessionFile, SaysWhatIsWrongAndWhere) {
  const auto said = [](const std::string& text) {
    return std::string(SessionFromText(text, "c.yaml", TwoViews()).status().message());
  };
  EXPECT_THAT(said("calibration: 2\n"), HasSubstr("c.yaml:1"));
  EXPECT_THAT(said("calibration: 2\n"), HasSubstr("version 2"));
  EXPECT_THAT(said("calibration: 1\nviews: [{name: top}]\n"), HasSubstr("'left: 2' of the cell"));
  EXPECT_THAT(said("calibration: 1\nviews: [{name: top}, {name: top}]\n"),
              HasSubstr("there twice"));
  EXPECT_THAT(said("calibration: 1\nviews: [{name: tip}]\n"), HasSubstr("no view 'tip'"));
  EXPECT_THAT(said("calibration: 1\nviews: [{name: top}, {name: 'left: 2'}]\n"),
              HasSubstr("neither cameras"));
  EXPECT_THAT(said("calibration: 1\nviews: [{name: top, camera: a}, {name: 'left: 2'}]\n"),
              HasSubstr("'left: 2' has no camera"));
  EXPECT_THAT(said("calibration: 1\nviws: []\n"), HasSubstr("viws"));
}

TEST(Fingerprint, IsOfTheCalibrationAndNotOfItsRecord) {
  const CalibrationSession session = Session();
  CalibrationSession other = session;
  other.calibration.clear_record();
  EXPECT_EQ(FingerprintOf(other.calibration), FingerprintOf(session.calibration));
  EXPECT_EQ(FingerprintOf(session.calibration).size(), 16u);
  other.calibration.mutable_fundamental_matrices(0)->set_f(4, 0.5);
  EXPECT_NE(FingerprintOf(other.calibration), FingerprintOf(session.calibration));
}

}  // namespace

}  // namespace silhouette
