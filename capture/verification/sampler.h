// SPDX-License-Identifier: Apache-2.0
// ModelSampler: configurations all over a robot's joint space, and whether it can go there
// straight.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <random>
#include <span>
#include <vector>

#include "calib/robot/drawing/drawn_robot.h"
#include "db/mask/configuration_grid.h"
#include "db/mask/joint_regions.h"

namespace silhouette {

struct SamplerSettings {
  // Links that are no neighbours keep this distance, and all keep it from the workspace's faces:
  // cables and hoses are not in the model. Metres.
  double clearance = 0.08;
  // The same of links with no more than two joints between them: wrists are built close.
  double clearance_of_near = 0.02;
  // Motions are looked at where no point of the robot moves farther than this, metres. Between two
  // looks two parts come nearer to each other by no more: each is within half of it of a look. So
  // with no more than the least clearance nothing touches.
  double step = 0.02;
  // Configurations that are tried until one can be reached.
  int most_tries = 20'000;
};

// For one thread.
class ModelSampler {
 public:
  // `joints`: the ranges that the joints of the robot are driven in. `workspace`: what the robot
  // must not leave, in its base's frame; what no joint moves may. `forbidden`: what it must not
  // move through, by its joints. The same seed gives the same configurations. Throws
  // std::invalid_argument if there is not a range for each joint.
  ModelSampler(const DrawnRobot& robot, std::span<const GridJoint> joints,
               const Eigen::AlignedBox3d& workspace, JointRegions forbidden,
               const SamplerSettings& settings, uint64_t seed);

  // The next one, to which the way from `here` is clear; nothing if chance finds none.
  std::optional<Configuration> Next(const Configuration& here);

  // Whether the robot touches neither itself nor the workspace's faces, with the clearance.
  bool IsClear(std::span<const double> q);
  // Whether it is so all along the straight motion, and no forbidden region is in the way.
  bool IsClearWay(std::span<const double> from, std::span<const double> to);

 private:
  // Two parts, and the distance that they keep.
  struct PartPair {
    size_t a = 0;
    size_t b = 0;
    double clearance = 0;
  };

  Configuration Any();
  // Of the joints between two links.
  int JointsBetween(size_t first, size_t second) const;
  // Whether two parts may be nearer than the clearance: by their balls, and by their points (E. G.
  // Gilbert, An iterative procedure for computing the minimum of a quadratic form on a convex set,
  // 1966).
  bool BallsAreNear(const PartPair& pair) const;
  bool AreNear(const PartPair& pair) const;
  // Whether parts that are looked at are near each other; or, to learn, how often each pair is.
  bool MeetsItself(bool learn);
  void LearnPairs();

  const DrawnRobot& robot_;
  const std::vector<GridJoint> joints_;
  const Eigen::AlignedBox3d workspace_;
  const JointRegions forbidden_;
  const SamplerSettings settings_;
  std::mt19937_64 random_;
  std::vector<bool> moves_;                 // by part
  std::vector<PartPair> pairs_;             // that may meet
  std::vector<std::vector<size_t>> balls_;  // by part
  std::vector<int> met_;                    // by pair, while they are learnt
  PlacedBalls placed_;
  std::vector<Eigen::Isometry3d> poses_;
};

}  // namespace silhouette
