// SPDX-License-Identifier: Apache-2.0
// The simulated cell with people in it, as its cameras see it, and the scenes that the live
// server's acquisition makes of their images.
#pragma once

#include <memory>
#include <vector>

#include "absl/status/statusor.h"
#include "capture/sim/simulated_cell.h"
#include "server/live/acquisition.h"
#include "server/live/live_record.h"
#include "tools/silhouette-experiments/cell/simulated_workplace.h"

namespace silhouette::people_experiment {

using cell_experiment::SimulatedWorkplace;

// What cameras gave, and the scene of it; null: there is none.
struct Sight {
  std::vector<CameraImage> images;  // by view
  SharedScene scene;
};

// For one thread. Refers to the workplace.
class RenderedCell {
 public:
  // `database`: has reference images. `seed`: of the noise, of what people wear, and of when the
  // episode begins in the light's drift.
  RenderedCell(const SimulatedWorkplace& workplace, std::shared_ptr<const ServedDatabase> database,
               size_t people, uint64_t seed);

  // Images taken at `now`, later than those before, with the robot at `q`. `parts`: poses in the
  // order of PeopleObstacles. Internal: the images could be used, but no scene could be made.
  absl::StatusOr<Sight> Look(std::span<const double> q, std::span<const Eigen::Isometry3d> parts,
                             const Moment& now);

 private:
  const SimulatedWorkplace& workplace_;
  const std::shared_ptr<const ServedDatabase> database_;
  SimulatedCell cell_;
  std::vector<Obstacle> people_;
  double begins_ = 0;  // of the cell's time, seconds
  std::vector<JointPosition> joints_;
  SharedScene newest_;
  std::shared_ptr<LiveRecord> record_;
  Acquisition acquisition_;
};

}  // namespace silhouette::people_experiment
