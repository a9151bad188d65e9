// SPDX-License-Identifier: Apache-2.0
// How good a view's camera is: what a solution says of points in its image, where boards were seen
// by it, and what a calibration says of corners that it did not know.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>
#include <cstddef>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "calib/camera/camera_model.h"
#include "calib/fundamental/epipolar_geometry.h"
#include "calib/poses/pose_calibration.h"
#include "calib/poses/pose_network.h"
#include "calib/poses/pose_problem.h"
#include "calib/report/quality_report.h"

namespace silhouette {

// Sums of squares, per axis of the image.
class PixelSum {
 public:
  void Add(const Eigen::Vector2d& error) { Add(error.squaredNorm() / 2); }
  // `square`: per axis.
  void Add(double square) {
    sum_ += square;
    ++count_;
  }
  int count() const { return count_; }
  double Rms() const { return count_ > 0 ? std::sqrt(sum_ / count_) : 0; }

 private:
  double sum_ = 0;
  int count_ = 0;
};

// Derivatives of a pixel: by a small motion (rotation vector, translation) of the frame on a pose's
// right-hand side, as PoseCovariance has it. The point is lens(before * pose * after * point), and
// `lens` has the identity as pose. Nothing if the point is not before the camera.
std::optional<Eigen::Matrix<double, 2, 6>> PixelByMotion(const CameraModel& lens,
                                                         const Eigen::Isometry3d& before,
                                                         const Eigen::Isometry3d& pose,
                                                         const Eigen::Vector3d& point);

// Variance per axis of a world point's pixel.
std::optional<double> PixelVariance(const CameraModel& lens, const SolvedView& view,
                                    const Eigen::Vector3d& point);

// The points that lie in the image of the camera at its solved pose.
std::vector<Eigen::Vector3d> PointsInImage(const CameraModel& lens, const SolvedView& view,
                                           std::span<const Eigen::Vector3d> points);

// `points`: of the workspace, in the image of the view. `parts`: solutions without a group each, at
// least two.
Repeatability JackknifeOf(const PoseProblem& problem, size_t view,
                          const std::vector<Eigen::Vector3d>& points,
                          const std::vector<PoseSolution>& parts);

// Of two solutions that have no frame in common.
HalvesDifference DifferenceOf(const PoseProblem& problem, size_t view,
                              const std::vector<Eigen::Vector3d>& points, const PoseSolution& a,
                              const PoseSolution& b);

// Fills the map of `view` from its points, and what follows of it: span, coverage and reach.
// `solved`: null where there is no calibration. `workspace`: points in the image.
void FillMap(const CameraModel& lens, const SolvedView* solved,
             const std::vector<Eigen::Vector3d>& workspace, ReportView& view);

// Corners of boards that are fixed to something, by a solution, in the world of views on the flange
// or of all others: points all over the box around them.
std::vector<Eigen::Vector3d> SpaceOfBoards(const PoseNetwork& network, const PoseSolution& solution,
                                           bool on_flange);

// ReportView::tilt_deg. By what each look alone says; the network has its candidates.
std::optional<double> TiltOf(const PoseNetwork& network, int view);

// The frames whose pose of the robot was left out and fits the one of the frame after it (`by` 1)
// or before it (-1) far better, by what each look alone says. `network`: of the problem, with
// candidates.
std::vector<std::string> FramesThatFitAnother(const PoseNetwork& network,
                                              const PoseSolution& solution, int by);

// Corners by the places of their sighting in the problem and in the tag.
using CornerSet = std::set<std::pair<size_t, int>>;

struct HeldOutCorner {
  size_t sighting = 0;  // in the problem
  int corner = 0;
  Eigen::Vector2d residual = Eigen::Vector2d::Zero();  // computed minus seen, pixels
  double expected = 0;                                 // variance per axis
};

struct HeldOutTask {
  const PoseProblem& problem;     // all of it
  const PoseSolution& full;       // of all of it: which poses of the robot are wrong
  const CornerSet& outliers;      // corners that count for nothing
  const PoseSolution& training;   // by the rest
  std::vector<size_t> sightings;  // that `training` did not know
};

// Image by image: where a frame's flange or loose board is, the robot or the survey says with the
// frame's other views, never the image itself. Corners of which neither does are left out, and
// those of frames whose pose of the robot is wrong.
std::vector<HeldOutCorner> PredictHeldOut(const HeldOutTask& task);

// How far corners that two views saw at once are from their epipolar lines.
class PairDistances {
 public:
  explicit PairDistances(const PoseProblem& problem) : problem_(problem) {}

  // What the cameras of `task.training` say of its sightings; not of tags with an outlier.
  void Add(const HeldOutTask& task);

  // All pairs of views that do not move.
  std::vector<ReportPair> Result() const;

 private:
  LineDistanceSum& SumOf(size_t a, size_t b);

  const PoseProblem& problem_;
  std::map<std::pair<size_t, size_t>, LineDistanceSum> sums_;
};

}  // namespace silhouette
