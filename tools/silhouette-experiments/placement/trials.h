// SPDX-License-Identifier: Apache-2.0
// Trials: sampled configurations and scenes with their truth, seen by every candidate camera, and
// how good any set of the cameras is in them.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/robot/robot_model.h"
#include "db/mask/configuration_grid.h"
#include "server/collision/obstacle_image.h"
#include "server/collision/policy.h"
#include "tools/silhouette-experiments/placement/places.h"
#include "tools/silhouette-experiments/placement/selection.h"

namespace silhouette {

// All joint values of the robot at a configuration of the grid.
using PositionsAt = std::function<absl::StatusOr<std::vector<double>>(const Configuration&)>;

// Called with the parts done and their total. Returning false stops.
using OnProgress = std::function<bool(uint64_t done, uint64_t total)>;

class Trials {
 public:
  // Samples by the seed, finds the truth by exact contact, and draws the silhouettes in all
  // candidates in which the robot is whole at all configurations (paper §2). Uses all processors.
  // Aborted: it was stopped. FailedPrecondition: no candidate has the whole robot in its image, or
  // there is no configuration at which the robot touches nothing.
  static absl::StatusOr<Trials> Make(const RobotModel& robot, const ConfigurationGrid& grid,
                                     const PositionsAt& positions_at, const Places& places,
                                     const OnProgress& progress);

  // The candidates that are left, by their index in Places::candidates.
  const std::vector<int>& usable() const { return usable_; }
  // What the robot covers at the sampled configurations, seen from above: the hull's corners, x, y.
  const std::vector<Eigen::Vector2d>& footprint() const { return footprint_; }

  // The measures of a set of usable() candidates, by index in usable(). Can be called from several
  // threads. Throws std::invalid_argument if the policy cannot be.
  Measures MeasuresOf(const CameraSet& cameras, const Policy& policy) const;

 private:
  struct Scene {
    size_t current = 0;                          // the robot's configuration
    std::vector<uint64_t> touching;              // one bit per configuration
    std::vector<ObstacleImage> obstacle_images;  // by camera
  };

  std::vector<int> usable_;
  std::vector<CameraModel> cameras_;             // usable ones
  std::vector<std::vector<Mask>> robot_images_;  // by camera and configuration
  std::vector<Scene> scenes_;
  std::vector<Eigen::Vector2d> footprint_;
  size_t configurations_ = 0;
};

}  // namespace silhouette
