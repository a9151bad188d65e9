// A simulated cell, captured and served in one process, with the truth beside it.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <memory>
#include <optional>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/robot/robot_body.h"
#include "capture/sim/contact.h"
#include "capture/sim/simulated_cell.h"
#include "server/scene/scene_store.h"
#include "server/scene/served_database.h"
#include "tools/cell/cell.h"

namespace silhouette::hidden_experiment {

// Told how much of the grid is captured; false: stop.
using CaptureProgress = std::function<bool(uint64_t done, uint64_t total)>;

class HiddenCell {
 public:
  // Captures every configuration of the grid into a new database in `folder`, calibrated by truth.
  // InvalidArgument, naming the file: a view is not simulated, or there is no section 'sound'.
  // Aborted: stopped by `progress`.
  static absl::StatusOr<HiddenCell> Capture(const std::string& cell_file, const std::string& folder,
                                            const CaptureProgress& progress);

  const Cell& cell() const { return cell_; }
  const ConfigurationGrid& grid() const { return cell_.grid; }
  double least_obstacle() const { return cell_.sound->least_obstacle; }
  const ServedDatabase& database() const { return *database_; }
  const RobotModel& robot() const { return simulation_->robot(); }
  // By view, for images of the size of its masks.
  const std::vector<CameraModel>& cameras() const { return cameras_; }

  Poses LinkPosesAt(std::span<const double> q) const { return robot().LinkPoses(PositionsAt(q)); }

  // Whether the robot may touch a ball at a configuration of the grid; if not, it does not.
  bool MayTouch(ConfigurationNumber number, const Eigen::Vector3d& centre, double radius) const {
    return bodies_[number].MayReach(centre, radius);
  }

  // What is served after the cameras' images of the robot at `q` and of the obstacles.
  Served SceneAt(std::span<const double> q, std::vector<Obstacle> obstacles);

 private:
  HiddenCell(Cell cell, std::shared_ptr<SimulatedCell> simulation);

  std::vector<JointPosition> JointsAt(std::span<const double> q) const;
  std::vector<double> PositionsAt(std::span<const double> q) const;
  absl::StatusOr<storage::v1::References> TakeReferences();
  // The foreground of one set of images.
  std::vector<Mask> TakeMasks(std::span<const double> q, std::span<const Reference> references);

  Cell cell_;
  std::shared_ptr<SimulatedCell> simulation_;
  std::vector<size_t> views_;  // the simulation's cameras
  std::vector<CameraModel> cameras_;
  std::shared_ptr<const ServedDatabase> database_;
  std::unique_ptr<const RobotBody> body_;
  std::vector<PosedBody> bodies_;  // by configuration
};

}  // namespace silhouette::hidden_experiment
