// SPDX-License-Identifier: Apache-2.0
// What a calibration says of corners that it did not know.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "calib/fundamental/epipolar_geometry.h"
#include "calib/poses/pose_problem.h"
#include "calib/poses/pose_solution.h"
#include "calib/report/quality_report.h"

namespace silhouette {

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
