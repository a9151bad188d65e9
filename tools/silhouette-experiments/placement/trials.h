// SPDX-License-Identifier: Apache-2.0
// Trials: sampled configurations and scenes with their truth, seen by every candidate camera, and
// how good any set of the cameras is in them. Then the choice of the best sets.
#pragma once

#include <cstdint>
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

namespace silhouette {

// How good a set of cameras is; counts over all scenes and test configurations.
struct Measures {
  int64_t tested = 0;
  int64_t occupied = 0;    // really
  int64_t missing = 0;     // reported free, really occupied
  int64_t additional = 0;  // reported occupied, really free

  // Fewer missing are better; among equals, fewer additional.
  bool BetterThan(const Measures& other) const {
    return missing != other.missing ? missing < other.missing : additional < other.additional;
  }
};

// Indices of candidates, in the order in which they were chosen.
using CameraSet = std::vector<int>;

// All joint values of the robot at a configuration of the grid.
using PositionsAt = std::function<absl::StatusOr<std::vector<double>>(const Configuration&)>;

// Called with the parts done and their total. Returning false stops.
using OnProgress = std::function<bool(uint64_t done, uint64_t total)>;

class Trials {
 public:
  // Those by which sets are chosen; as many others, by which the chosen ones are judged.
  enum class Scenes { kOfChoice, kFresh };

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
  Measures MeasuresOf(const CameraSet& cameras, const Policy& policy,
                      Scenes scenes = Scenes::kOfChoice) const;

 private:
  struct Scene {
    size_t current = 0;                          // the robot's configuration
    std::vector<uint64_t> touching;              // one bit per configuration
    std::vector<ObstacleImage> obstacle_images;  // by camera
  };

  std::vector<int> usable_;
  std::vector<CameraModel> cameras_;             // usable ones
  std::vector<std::vector<Mask>> robot_images_;  // by camera and configuration
  std::vector<Scene> scenes_;                    // of choice, then as many fresh ones
  std::vector<Eigen::Vector2d> footprint_;
  size_t configurations_ = 0;
};

// Choosing cameras: greedy, with exchange.

// The measures of several sets.
using Evaluate = std::function<std::vector<Measures>(const std::vector<CameraSet>&)>;

// The best set found of one size.
struct Selection {
  CameraSet cameras;
  Measures measures;
};

// For every size from 1 to `count`, at most `candidates`: the best set of the size before with the
// best camera added to it; then, as long as that helps, one camera exchanged for another. Among
// equals the lowest numbers win, so that the same input gives the same sets. Stops, with the sizes
// finished by then, when `stop` says so.
std::vector<Selection> Select(int candidates, int count, const Evaluate& evaluate,
                              const std::function<bool()>& stop);

}  // namespace silhouette
