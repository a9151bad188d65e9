// SPDX-License-Identifier: Apache-2.0
// What `silhouette-experiments calibration` measures, and that a run meets its bars.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "tools/silhouette-experiments/calibration/error_lines.h"
#include "tools/silhouette-experiments/calibration/figures.h"
#include "tools/silhouette-experiments/calibration/model_errors.h"
#include "tools/silhouette-experiments/calibration/rendered_boards.h"
#include "tools/silhouette-experiments/calibration/rig.h"
#include "tools/silhouette-experiments/calibration/trials.h"

namespace silhouette::calibration_experiment {
namespace {

const Bar& BarOf(const std::string& name) {
  for (const Bar& bar : Bars()) {
    if (bar.name == name) return bar;
  }
  throw std::out_of_range(name);
}

void ExpectWithinBars(const Figures& figures, const std::set<std::string>& names) {
  for (const std::string& name : names) {
    ASSERT_TRUE(figures.contains(name)) << name;
    const double value = figures.at(name);
    EXPECT_TRUE(Passes(BarOf(name), {.median = value, .worst = value})) << name << " " << value;
  }
}

TEST(CalibrationFigures, MedianAndWorstAreOverTheRunsThatHaveTheFigure) {
  const std::vector<Figures> runs{{{"corner_px", 0.02}}, {{"corner_px", 0.01}}, {}};
  const Spread spread = SpreadOf(BarOf("corner_px"), runs);
  EXPECT_DOUBLE_EQ(spread.median, 0.015);
  EXPECT_DOUBLE_EQ(spread.worst, 0.02);
}

TEST(CalibrationFigures, WorstOfARatioIsFarthestFromOne) {
  const Bar& bar = BarOf("chi2_per_dof");
  EXPECT_DOUBLE_EQ(SpreadOf(bar, {{{"chi2_per_dof", 0.5}}, {{"chi2_per_dof", 1.2}}}).worst, 0.5);
  EXPECT_DOUBLE_EQ(SpreadOf(bar, {{{"chi2_per_dof", 0.9}}, {{"chi2_per_dof", 1.2}}}).worst, 1.2);
  EXPECT_FALSE(Passes(bar, {.median = 1, .worst = 0.5}));
  EXPECT_TRUE(Passes(bar, {.median = 1, .worst = 0.9}));
}

TEST(JointErrors, ErrorsOfOneCauseCountOnce) {
  // Two causes; ten pixels that all show the first, one of which shows the second as well.
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(2, 2);
  covariance.diagonal() << 4, 0.25;
  JointErrors errors;
  for (int pixel = 0; pixel < 10; ++pixel) {
    Eigen::Matrix<double, 2, Eigen::Dynamic> derivative(2, 2);
    derivative << 1, 0, 0, pixel == 0 ? 1 : 0;
    // The first cause is off by three standard deviations, the second by one.
    errors.Add(derivative, derivative * Eigen::Vector2d(6, 0.5));
  }
  const ChiSquared joint = errors.Against(covariance);
  EXPECT_EQ(joint.freedom, 2);
  EXPECT_NEAR(joint.squares, 9 + 1, 1e-9);
  EXPECT_NEAR(joint.PerFreedom(), 5, 1e-9);
}

TEST(JointErrors, DirectionsThatHardlyMoveAnyPixelAreLeftOut) {
  JointErrors errors;
  Eigen::Matrix<double, 2, Eigen::Dynamic> derivative(2, 2);
  derivative << 1, 0, 0, 1e-5;
  errors.Add(derivative, {2, 1});  // far more than 1e-5 says; it is rounding
  const ChiSquared joint = errors.Against(Eigen::MatrixXd::Identity(2, 2));
  EXPECT_EQ(joint.freedom, 1);
  EXPECT_NEAR(joint.squares, 4, 1e-9);
}

TEST(CalibrationRig, SessionShowsTheBoardAllOverEveryImage) {
  const Rig rig = DrawRig(5);
  const BoardFrames session = DrawSession(rig, 80, 0, 5);
  EXPECT_EQ(session.frames.size(), 80u);
  for (const NamedCamera& camera : rig.cameras) {
    std::set<int> fields;  // of 6 x 4
    for (const TagSighting& sighting : session.sightings) {
      if (sighting.view != camera.view) continue;
      for (const Eigen::Vector2d& corner : sighting.corners) {
        fields.insert(static_cast<int>(corner.x() * 6 / 1280) +
                      6 * static_cast<int>(corner.y() * 4 / 960));
      }
    }
    EXPECT_EQ(fields.size(), 24u) << camera.view;
  }
}

TEST(CalibrationTrials, CornersOfRenderedTagsAreFound) {
  ExpectWithinBars(MeasureCorners(3), {"corner_px"});
}

TEST(CalibrationTrials, CameraFilesLoseNothing) {
  const auto figures = MeasureRoundTrip(3);
  ASSERT_TRUE(figures.ok()) << figures.status();
  ExpectWithinBars(*figures, {"roundtrip_px"});
}

TEST(CalibrationTrials, LensesAreFound) {
  const auto figures = MeasureLenses(3, 1);
  ASSERT_TRUE(figures.ok()) << figures.status();
  ExpectWithinBars(*figures, {"workspace_px", "epipolar_px", "weak_epipolar_px", "band_misses"});
  // Of one calibration, some 60 degrees of freedom: three and a half standard deviations.
  EXPECT_NEAR(figures->at("chi2_per_dof"), 1, 0.65);
  EXPECT_GT(figures->at("seconds"), 0);
}

TEST(CalibrationTrials, CamerasAreFoundFromATagOnTheFlange) {
  const auto figures = MeasureFlange(3);
  ASSERT_TRUE(figures.ok()) << figures.status();
  ExpectWithinBars(*figures, {"flange_mm", "flange_deg", "workspace_mm"});
}

const ErrorLine& LineOf(const std::string& name) {
  for (const ErrorLine& line : ErrorLines()) {
    if (line.name == name) return line;
  }
  throw std::out_of_range(name);
}

TEST(ModelErrors, WithoutErrorsSightingsStayAsTheyAre) {
  const Rig rig = DrawRig(3);
  BoardFrames session = DrawSession(rig, 6, 0.1, 3);
  const BoardFrames before = session;
  Disturb(rig.cameras, HandBoard(), {}, 3, session);
  for (size_t i = 0; i < session.sightings.size(); ++i) {
    EXPECT_LT((session.sightings[i].corners[0] - before.sightings[i].corners[0]).norm(), 1e-9);
  }
}

TEST(ModelErrors, EveryErrorMovesCornersByLessThanTwoPixels) {
  const Rig rig = DrawRig(3);
  const BoardFrames clean = DrawSession(rig, 6, 0, 3);
  for (const std::string name : {"scaled", "sheared", "bent", "lens", "late", "blur"}) {
    BoardFrames session = clean;
    Disturb(rig.cameras, HandBoard(), LineOf(name).errors, 3, session);
    double most = 0;
    for (size_t i = 0; i < session.sightings.size(); ++i) {
      most =
          std::max(most, (session.sightings[i].corners[0] - clean.sightings[i].corners[0]).norm());
    }
    EXPECT_GT(most, 0.02) << name;
    EXPECT_LT(most, 2) << name;
  }
}

TEST(ModelErrors, ARefusedRunMissesTheGoalsUnlessTheLineAllowsIt) {
  LineResult result;
  result.runs = 4;
  result.predicted.Add({.squares = 10, .freedom = 10});
  EXPECT_TRUE(MeetsGoals(result));
  EXPECT_TRUE(IsRefusal(absl::FailedPreconditionError("too few"), result));
  EXPECT_FALSE(MeetsGoals(result));
  result.most_refused = LineOf("few").most_refused;
  EXPECT_TRUE(MeetsGoals(result));
  EXPECT_TRUE(IsRefusal(absl::FailedPreconditionError("too few"), result));
  EXPECT_FALSE(MeetsGoals(result)) << "half of the runs";
}

TEST(ModelErrors, LensesOfABentBoardAreAsExactAsPredicted) {
  LineResult result;
  const absl::Status status = MeasureLensLine(LineOf("bent"), 3, false, result);
  ASSERT_TRUE(status.ok()) << status;
  EXPECT_EQ(result.refused, 0);
  EXPECT_LT(result.error.Result(), 0.06);
  // Of one calibration, some 60 degrees of freedom.
  EXPECT_NEAR(result.predicted.PerFreedom(), 1, 0.65);
}

TEST(ModelErrors, PosesAreAtLeastTwiceAsExactAsOpenCvsBestMethod) {
  for (const std::string name : {"none", "bent", "late", "wrong"}) {
    LineResult result;
    const absl::Status status = MeasurePoseLine(LineOf(name), 3, result);
    ASSERT_TRUE(status.ok()) << name << ": " << status;
    EXPECT_EQ(result.refused, 0) << name;
    EXPECT_GT(result.others.count(), 0) << name;
    EXPECT_LE(WorseThanOthers(result), -0.5) << name;
  }
}

TEST(RenderedBoards, OfEveryKindAreFoundWithoutAFalseCornerAndGiveALens) {
  for (const BoardLine& line : BoardLines()) {
    SCOPED_TRACE(line.name);
    BoardResult result;
    const absl::Status status = MeasureBoardLine(line, 10, 4, result);
    ASSERT_TRUE(status.ok()) << status;
    EXPECT_GT(result.corners.ShareFound(), 0.85);
    EXPECT_EQ(result.corners.false_corners(), 0u);
    EXPECT_LT(result.corners.Rms(), 0.08);
    EXPECT_NEAR(std::sqrt(result.stated.PerFreedom()), 1, 0.5);
    if (result.of_opencv.visible() > 0) {
      EXPECT_GE(result.corners.ShareFound(), result.of_opencv.ShareFound());
      EXPECT_LT(result.corners.Rms(), result.of_opencv.Rms());
    }
    EXPECT_EQ(result.lens.refused, 0) << result.lens.refusal;
    EXPECT_LT(result.lens.error.Result(), 0.3);
  }
}

}  // namespace
}  // namespace silhouette::calibration_experiment
