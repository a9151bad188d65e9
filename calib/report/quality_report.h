// SPDX-License-Identifier: Apache-2.0
// QualityReport: how good a calibration is, by data that it was not made from. A plain value.
//
// Pixels are of the camera images. Errors in pixels are root mean squares per axis where nothing
// else is said, as are the corners' sigmas; millimetres and degrees are of the length of the error.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/poses/pose_problem.h"

namespace silhouette {

// A corner of a tag, for the map of residuals. Residuals: computed minus seen.
struct ReportCorner {
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  Eigen::Vector2d fit = Eigen::Vector2d::Zero();
  std::optional<Eigen::Vector2d> held_out{};
  bool outlier = false;  // left out
};

struct MapCell {
  int corners = 0;                                 // without outliers
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();  // residual of the fit
  double fit_px = 0;
  int points = 0;           // of the workspace, that appear here
  double predicted_px = 0;  // over these points
};

// A view's image in fields of equal size, row by row from the top left.
struct ImageMap {
  int columns = 0;
  int rows = 0;
  std::vector<MapCell> cells;
};

// How far corners are from where a calibration has them that did not know them, and how far that
// was to be expected from the sigmas of corners, robot, survey and cameras.
struct HeldOutError {
  int corners = 0;
  double px = 0;
  double expected_px = 0;
};

// By how much a camera's image of the workspace is uncertain through the camera's pose alone. Its
// lens is taken for exact.
struct PredictedError {
  int points = 0;  // of the workspace, in the image
  double px = 0;
  double worst_px = 0;  // of a point
  double mm = 0;        // of the points' places
};

// By how much the camera would differ in another session of this kind: the jackknife's standard
// error, each group of frames left out once.
struct Repeatability {
  double px = 0;   // over the points of the workspace
  double mm = 0;   // of the camera's centre
  double deg = 0;  // of its rotation
};

// The camera by the first half of the frames against that by the second.
struct HalvesDifference {
  double px = 0;  // over the points of the workspace
  double expected_px = 0;
};

struct ReportView {
  std::string name{};
  bool on_flange = false;  // its world is the flange
  int width = 0;
  int height = 0;
  int frames = 0;  // in which it saw a board
  int corners = 0;
  int outliers = 0;
  double span_x = 0;  // share of the image's width, from the leftmost corner to the rightmost
  double span_y = 0;
  double coverage = 0;  // share of the map's fields with corners
  double reached = 0;   // share of the workspace in the image that lies in such a field or beside
  // Standard deviation of the boards' normals about the axis about which they turned least; of
  // boards that move against the view with the robot.
  std::optional<double> tilt_deg{};
  double fit_px = 0;
  HeldOutError held_out{};
  PredictedError predicted{};
  std::optional<Repeatability> repeatability{};
  std::optional<HalvesDifference> halves{};
  ImageMap map{};
  std::vector<ReportCorner> points{};
};

// Distances of corners that both views saw at once from their epipolar lines, in both images, of
// undistorted pixels; by cameras that did not know the corners.
struct ReportPair {
  std::string view_a{};
  std::string view_b{};
  int seen = 0;     // corners that both saw at once
  int corners = 0;  // of these, without outliers and such as could not be held out
  double px = 0;    // root mean square
  double median_px = 0;
  double worst_px = 0;
};

struct ReportImage {
  std::string frame{};
  std::string view{};
  int corners = 0;
  int outliers = 0;
  double fit_px = 0;
  HeldOutError held_out{};
};

// Of the robot in a frame: by how much the flange stood elsewhere than it said.
struct ReportFrame {
  std::string name{};
  bool robot = false;  // took part; else what follows means nothing
  double robot_mm = 0;
  double robot_deg = 0;
  bool robot_outlier = false;
};

enum class HeldOutBy { kNothing, kFrames, kBoards };

struct QualityReport {
  std::string refusal;  // why there is no calibration, with the mend; empty: there is one
  std::vector<std::string> warnings;  // one sentence each
  std::vector<std::string> doubts;    // of the warnings, those for which `poses` refuses
  std::vector<ReportView> views;
  std::vector<ReportPair> pairs;    // of views that do not move
  std::vector<ReportImage> images;  // frame by frame
  std::vector<ReportFrame> frames;
  std::string workspace;  // which points that is, in words
  HeldOutBy held_out_by = HeldOutBy::kNothing;
  int groups = 0;  // left out one at a time, and of which the rest gave a calibration
  double chi2_per_dof = 0;
  int dof = 0;
  // How many times the stated sigmas the errors look; 0: not known.
  double image_noise_factor = 0;
  double robot_noise_factor = 0;
  double survey_noise_factor = 0;
};

// The limits behind the colours and warnings of a report.
enum class Grade { kUnknown, kGood, kFair, kBad };

// good, fair, bad or unknown: also the class of the page's style.
const char* NameOf(Grade grade);

Grade GradeOf(const HeldOutError& error);
Grade GradeOf(const Repeatability& repeatability, const PredictedError& predicted);
Grade GradeOf(const HalvesDifference& halves);
// `width`: of the image; masks have about a tenth of its pixels and fewer.
Grade GradeOf(const PredictedError& predicted, int width);
Grade GradeOfCoverage(const ReportView& view);
Grade GradeOfTilt(const ReportView& view);
// `expected`: what the held-out corners of both views let expect.
Grade GradeOfLines(const ReportPair& pair, const QualityReport& report);
Grade GradeOfChi2(double chi2_per_dof);
// The worst of a view's, and of the report's.
Grade GradeOf(const ReportView& view);
Grade GradeOf(const QualityReport& report);

// Whether there is a calibration that frames left out, and the halves of the session, do not
// contradict, and that is not doubted.
bool IsStable(const QualityReport& report);

// What the report's figures give reason to warn of, one sentence each.
std::vector<std::string> WarningsOf(const QualityReport& report);

struct ReportSettings {
  // What PoseProblem::workspace is, in words. Without one it is the space in which boards were
  // seen.
  std::string workspace_name;
  int groups = 8;  // of frames, left out one at a time; at least 2
};

// What CalibratePoses refuses with FailedPrecondition becomes the report's refusal, beside what can
// be said all the same. InvalidArgument as CalibratePoses, and for fewer than two groups.
absl::StatusOr<QualityReport> MakeReport(const PoseProblem& problem,
                                         const ReportSettings& settings = {});

}  // namespace silhouette
