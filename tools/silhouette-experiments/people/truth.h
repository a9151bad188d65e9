// SPDX-License-Identifier: Apache-2.0
// What is true of robot and people at an instant: how far they are apart, whether they touch, and
// what cameras see of them.
#pragma once

#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/robot/drawing/drawn_robot.h"
#include "capture/sim/contact.h"
#include "server/scene/make_scene.h"
#include "tools/silhouette-experiments/cell/simulated_workplace.h"
#include "tools/silhouette-experiments/people/person.h"

namespace silhouette::people_experiment {

using cell_experiment::SimulatedWorkplace;

// The robot exactly as its model says, seen by the true cameras in masks of `sizes`.
absl::StatusOr<DrawnRobot> TrueRobot(const SimulatedWorkplace& workplace,
                                     std::span<const MaskSize> sizes);

// How far the robot's fastest point moves on a straight line in joint space if it is as fast all
// along as where it is fastest, metres.
double FastestMovement(const DrawnRobot& robot, std::span<const double> from,
                       std::span<const double> to);

// Distances between robot and people at an instant. For one thread. Refers to its arguments.
class Truth {
 public:
  Truth(const SimulatedWorkplace& workplace, const DrawnRobot& robot, size_t people);

  void Set(std::span<const Person> people, std::span<const double> times);
  const std::vector<PlacedShape>& parts() const { return parts_; }

  // A lower bound from balls about the robot's parts, metres.
  double AtLeast(std::span<const double> q);
  // Exact as far as it is below `limit`; else at least that.
  double Distance(std::span<const double> q, double limit);
  bool Touches(std::span<const double> q) { return Distance(q, kSurelyApart) <= 0; }

 private:
  static constexpr double kSurelyApart = 0.01;  // what meshes may differ from their shapes

  const SimulatedWorkplace& workplace_;
  const DrawnRobot& robot_;
  const ContactChecker contact_;
  std::vector<PlacedShape> parts_;
  Poses obstacles_;
  std::vector<Eigen::Isometry3d> links_;
  PlacedBalls balls_;
};

// Shares of mask pixels, measured by `silhouette-experiments segmentation`.
struct SegmentationErrors {
  double missed = 0.0012;  // of those that show somebody
  double added = 0.00012;  // of all
};

// Masks as the segmentation makes them: every pixel that robot or people touch, with errors. For
// one thread. Refers to its arguments.
class TrueMasks {
 public:
  // `captured`: the robot images that verdicts rest on, if they were captured: then the robot's
  // image is nowhere larger than those about its configuration, nor smaller than what they share.
  TrueMasks(const DrawnRobot& robot, const RobotImageTable* captured, SegmentationErrors errors)
      : robot_(robot), captured_(captured), errors_(errors) {}

  // A mask for each view. `q`: within the grid.
  std::vector<Mask> Draw(std::span<const double> q, std::span<const PlacedShape> people,
                         Chance& chance);

 private:
  Mask RobotMask(size_t view, std::span<const double> q);

  const DrawnRobot& robot_;
  const RobotImageTable* captured_;
  SegmentationErrors errors_;
  std::vector<Eigen::Isometry3d> links_;
  DrawingScratch scratch_;
};

}  // namespace silhouette::people_experiment
