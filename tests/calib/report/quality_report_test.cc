// SPDX-License-Identifier: Apache-2.0
// What a report says of made-up sessions whose truth is known.
#include "calib/report/quality_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "calib/poses/pose_calibration.h"
#include "tests/calib/poses/pose_rig.h"
#include "tests/random.h"

namespace silhouette {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

// Three groups: they are quicker than eight.
QualityReport ReportOf(const PoseProblem& problem,
                       const ReportSettings& settings = {.workspace_name{}, .groups = 3}) {
  absl::StatusOr<QualityReport> report = MakeReport(problem, settings);
  EXPECT_TRUE(report.ok()) << report.status();
  return report.ok() ? *std::move(report) : QualityReport{};
}

TEST(QualityReport, HeldOutErrorsOfGoodDataAreThoseOfTheNoise) {
  const PoseRig rig = FlangeRig(2);
  const QualityReport report = ReportOf(rig.problem, {});
  EXPECT_THAT(report.warnings, IsEmpty());
  EXPECT_EQ(report.refusal, "");
  EXPECT_EQ(report.held_out_by, HeldOutBy::kFrames);
  EXPECT_EQ(report.groups, 8);
  EXPECT_EQ(GradeOf(report), Grade::kGood);
  ASSERT_EQ(report.views.size(), 4u);
  for (const ReportView& view : report.views) {
    EXPECT_EQ(view.held_out.corners, view.corners) << view.name;
    // The corners' noise alone is in the fit, and what robot and cameras add in what is held out.
    EXPECT_LT(view.fit_px, rig.corner_sigma);
    EXPECT_GT(view.held_out.px, rig.corner_sigma);
    EXPECT_LT(view.held_out.px, 2 * rig.corner_sigma);
    EXPECT_NEAR(view.held_out.px / view.held_out.expected_px, 1, 0.35) << view.name;
    ASSERT_TRUE(view.repeatability.has_value());
    EXPECT_NEAR(view.repeatability->px / view.predicted.px, 1.1, 0.5) << view.name;
    ASSERT_TRUE(view.halves.has_value());
    EXPECT_LT(view.halves->px, 2 * view.halves->expected_px) << view.name;
  }
  for (const ReportPair& pair : report.pairs) {
    EXPECT_EQ(pair.corners, pair.seen);
    EXPECT_LT(pair.px, 3 * rig.corner_sigma) << pair.view_a << pair.view_b;
  }
}

TEST(QualityReport, HeldOutErrorsGrowWithTheNoise) {
  PoseRig rig(3);
  rig.corner_sigma = 0.3;
  rig.AddFlangeBoard();
  rig.Drive(30);
  const QualityReport report = ReportOf(rig.problem);
  for (const ReportView& view : report.views) {
    EXPECT_NEAR(view.held_out.px / view.held_out.expected_px, 1, 0.35) << view.name;
    EXPECT_GT(view.held_out.px, 0.8 * rig.corner_sigma) << view.name;
  }
}

TEST(QualityReport, ThePredictedErrorIsThatOfTheTruth) {
  double square = 0;
  int points = 0;
  for (unsigned seed = 1; seed <= static_cast<unsigned>(SampleCount(4)); ++seed) {
    PoseRig rig = FlangeRig(seed, 3, 20);
    rig.problem.workspace = {{0, 0, 0.7}, {0.3, -0.2, 0.5}};
    const QualityReport report = ReportOf(rig.problem, {.workspace_name = "two", .groups = 2});
    EXPECT_EQ(report.workspace, "two");
    const PoseSolution solution = *CalibratePoses(rig.problem);
    for (size_t v = 0; v < 3; ++v) {
      const CameraModel solved(rig.problem.views[v].lens, solution.views[v].camera_pose);
      const CameraModel truth(rig.problem.views[v].lens, rig.camera_poses[v]);
      EXPECT_EQ(report.views[v].predicted.points, 2);
      for (const Eigen::Vector3d& point : rig.problem.workspace) {
        square += (*solved.Project(point) - *truth.Project(point)).squaredNorm() / 2 /
                  std::pow(report.views[v].predicted.px, 2);
        ++points;
      }
    }
  }
  EXPECT_GT(square / points, 0.5);
  EXPECT_LT(square / points, 1.7);
}

TEST(QualityReport, ACameraThatMovedHalfwayIsShownAsUnstable) {
  PoseRig rig = FlangeRig(5, 3);
  for (TagSighting& seen : rig.problem.sightings) {
    if (seen.view != "camera1" || seen.frame < "frame1015") continue;
    for (Eigen::Vector2d& corner : seen.corners) corner.x() += 0.8;
  }
  const QualityReport report = ReportOf(rig.problem);
  EXPECT_THAT(report.warnings, Contains(AllOf(HasSubstr("first half"), HasSubstr("'camera1' ("),
                                              Not(HasSubstr("'camera2'")))));
  EXPECT_THAT(report.doubts, ElementsAre(HasSubstr("'camera1' moved: from the frame 'frame1015'")));
  EXPECT_FALSE(IsStable(report));
  EXPECT_EQ(GradeOf(report.views[1]), Grade::kBad);
  ASSERT_TRUE(report.views[1].halves.has_value());
  EXPECT_GT(report.views[1].halves->px, 3 * report.views[1].halves->expected_px);
  EXPECT_LT(report.views[2].halves->px, 2 * report.views[2].halves->expected_px);
  EXPECT_GT(report.views[1].repeatability->px, 2 * report.views[1].predicted.px);
}

TEST(QualityReport, TooFewTiltsAreTold) {
  PoseRig rig(7);
  rig.AddFlangeBoard();
  for (int i = 0; i < 30; ++i) {
    rig.Take("f" + std::to_string(100 + i), rig.RandomFlange({0, 0, 100}, 3 * kRigDegree));
  }
  EXPECT_THAT(ReportOf(rig.problem).warnings,
              Contains(AllOf(HasSubstr("'camera2' saw too few tilts"), HasSubstr("20 deg"))));
}

TEST(QualityReport, BoardsInOnePlaceOfTheImageAreTold) {
  PoseRig rig(8, 1);
  rig.AddFlangeBoard(0.06);
  const Eigen::Vector3d at = rig.camera_poses[0].inverse().translation();
  for (int i = 0; i < 20; ++i) {
    Eigen::Isometry3d flange = rig.RandomFlange(at);
    flange.translation() = Eigen::Vector3d(0, 0, 0.7) + 0.1 * flange.translation();
    rig.Take("f" + std::to_string(i), flange);
  }
  const QualityReport report = ReportOf(rig.problem);
  EXPECT_THAT(report.warnings, Contains(HasSubstr("'camera0' were in one place of its image")));
  EXPECT_LT(report.views[0].span_x, 0.25);
}

TEST(QualityReport, AViewThatNeverSeesATagWithAnotherIsTold) {
  PoseRig rig = FlangeRig(9, 2, 40);
  std::erase_if(rig.problem.sightings, [](const TagSighting& seen) {
    return (seen.view == "camera0") == (std::stoi(seen.frame.substr(5)) % 2 == 0);
  });
  const QualityReport report = ReportOf(rig.problem);
  EXPECT_THAT(report.warnings, Contains(HasSubstr("'camera0' is not connected to the others")));
  ASSERT_EQ(report.pairs.size(), 1u);
  EXPECT_EQ(report.pairs[0].seen, 0);
}

TEST(QualityReport, AnImageLostMidwayIsToldByThePairing) {
  PoseRig rig = FlangeRig(6);
  const std::vector<RobotPose> poses = rig.problem.robot_poses;
  for (size_t i = 23; i + 1 < poses.size(); ++i) {
    rig.problem.robot_poses[i].base_from_flange = poses[i + 1].base_from_flange;
  }
  EXPECT_THAT(ReportOf(rig.problem).warnings,
              Contains(AllOf(HasSubstr("shifted by one"), HasSubstr("'frame1025'"),
                             HasSubstr("the pose of the frame before"))));
}

TEST(QualityReport, WhereNothingCanBeHeldOutItSaysWhatThatNeeds) {
  const QualityReport report = ReportOf(FlangeRig(3, 2, 6).problem);
  EXPECT_EQ(report.refusal, "");
  EXPECT_EQ(report.held_out_by, HeldOutBy::kNothing);
  EXPECT_THAT(report.warnings, Contains(HasSubstr("a calibration by the rest of them")));
}

TEST(QualityReport, ARefusalLeavesWhatWasSeen) {
  PoseRig rig = FlangeRig(4);
  std::erase_if(rig.problem.sightings,
                [](const TagSighting& seen) { return seen.view == "camera2"; });
  const QualityReport report = ReportOf(rig.problem);
  EXPECT_THAT(report.refusal, HasSubstr("'camera2'"));
  EXPECT_THAT(report.warnings, ElementsAre(HasSubstr("'camera2' saw no tag")));
  EXPECT_EQ(GradeOf(report), Grade::kBad);
  EXPECT_GT(report.views[0].coverage, 0.05);
  EXPECT_GT(report.views[0].tilt_deg.value_or(0), 5);
  EXPECT_EQ(report.views[0].held_out.corners, 0);
  rig.problem.views.push_back(rig.problem.views[0]);
  EXPECT_EQ(MakeReport(rig.problem).status().code(), absl::StatusCode::kInvalidArgument);
}

TEST(QualityReport, ARefusalCountsEveryCornerOfAChessboardOnce) {
  PoseRig rig(4);
  rig.AddFlangeBoard();
  rig.problem.boards[0].board = Board(
      {.name = "flange", .kind = BoardKind::kChessboard, .rows = 4, .columns = 5, .square = 0.03});
  rig.Drive(30);
  std::erase_if(rig.problem.sightings,
                [](const TagSighting& seen) { return seen.view == "camera2"; });
  const QualityReport report = ReportOf(rig.problem);
  EXPECT_THAT(report.refusal, HasSubstr("'camera2'"));
  for (const ReportView& view : report.views) {
    const auto seen = std::ranges::count(rig.problem.sightings, view.name, &TagSighting::view);
    EXPECT_EQ(view.corners, seen) << view.name;
    EXPECT_EQ(std::ssize(view.points), seen) << view.name;
  }
}

TEST(QualityReport, OfOneImageSurveyedBoardsAreHeldOut) {
  PoseRig rig(10);
  rig.AddFloorTags();
  rig.Take("one", Eigen::Isometry3d::Identity());
  const QualityReport report = ReportOf(rig.problem);
  EXPECT_EQ(report.held_out_by, HeldOutBy::kBoards);
  EXPECT_THAT(report.warnings, IsEmpty());
  for (const ReportView& view : report.views) {
    EXPECT_GT(view.held_out.corners, 10) << view.name;
    EXPECT_LT(view.held_out.px, 1.4 * view.held_out.expected_px) << view.name;
  }
}

TEST(QualityReport, BoardsInTheHandAreHeldOutByTheOtherViews) {
  const PoseRig rig = HeldBoardRig(12, 16);
  const QualityReport report = ReportOf(rig.problem);
  EXPECT_GT(report.views[2].held_out.corners, 100);
  EXPECT_LT(report.views[2].held_out.px, 2 * report.views[2].held_out.expected_px);
  EXPECT_TRUE(report.views[2].halves.has_value());
}

}  // namespace
}  // namespace silhouette
