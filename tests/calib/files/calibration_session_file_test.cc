// SPDX-License-Identifier: Apache-2.0
#include "calib/files/calibration_session_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "calib/files/calibration_message.h"

namespace silhouette {
namespace {

using testing::HasSubstr;

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
