// SPDX-License-Identifier: Apache-2.0
// A cell.yaml whose robot and cameras are simulated, as experiments use it: the cell, its truth,
// and its database, captured if need be.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/camera/calibration.h"
#include "calib/robot/parts.h"
#include "capture/session/capture_observer.h"
#include "capture/sim/simulated_cell.h"
#include "db/store/store.h"
#include "server/scene/served_database.h"
#include "tools/cell/cell.h"

namespace silhouette::cell_experiment {

// InvalidArgument, naming the file, unless StatesAGrid. `otherwise`: what else the user can do.
absl::Status CheckGridIsStated(const Cell& cell, const std::string& otherwise = "");

// What is served in another way than the cell's file says.
struct ServeSettings {
  // In pixels, in place of the views' own margins.
  std::optional<double> margin;
  // Metres; in place of the cell's own. If the cell states no `sound`, the model is then taken for
  // all there is of the robot.
  std::optional<double> least_obstacle;
  // Speed and separation, in place of the cell's own; needs a least obstacle.
  std::optional<SeparationCell> separation;
  // In place of the database's.
  std::optional<Calibration> calibration;
  // What robot images are drawn from; nothing: they are those of the database.
  std::optional<PartSettings> drawn;
};

// Cannot be changed once loaded, but for the state of `simulation`.
class SimulatedWorkplace {
 public:
  // `database`: as in LoadCell. InvalidArgument, naming the file, if robot or views are not
  // simulated; errors of the files.
  static absl::StatusOr<SimulatedWorkplace> Load(const std::string& cell_file,
                                                 const std::string& database = "");

  const Cell& cell() const { return cell_; }
  const RobotModel& robot() const { return simulation_->robot(); }
  SimulatedCell& simulation() const { return *simulation_; }
  // By view: the camera's index in the simulation.
  std::span<const size_t> cameras() const { return cameras_; }

  // The true calibration: the simulation's camera models, one per view.
  Calibration TrueCalibration() const;

  // Values in the order of the robot's joints from those of the grid's.
  std::vector<double> Positions(std::span<const double> configuration) const;
  Poses LinkPoses(std::span<const double> configuration) const {
    return robot().LinkPoses(Positions(configuration));
  }

  // Takes the reference images, if there are none, captures what the database lacks, and keeps the
  // true calibration in it, if it has none; makes the database if there is none. FailedPrecondition
  // if the one there is another cell's. InvalidArgument: CheckGridIsStated. Cancelled if the
  // observer asks for a stop: what was captured is stored.
  absl::StatusOr<std::unique_ptr<Database>> OpenOrCapture(const std::string& path,
                                                          const CaptureObserver& observer) const;

  // The same without robot images: for those that are drawn.
  absl::StatusOr<std::unique_ptr<Database>> OpenUncaptured(const std::string& path) const;

  // The database as the server of the cell's file serves it.
  absl::StatusOr<std::shared_ptr<const ServedDatabase>> Serve(const Database& database,
                                                              const ServeSettings& settings) const;

 private:
  SimulatedWorkplace(Cell cell, std::shared_ptr<SimulatedCell> simulation)
      : cell_(std::move(cell)), simulation_(std::move(simulation)) {}

  absl::Status TakeReferenceImages(Database& database) const;
  absl::Status Capture(Database& database, const CaptureObserver& observer) const;
  absl::Status Calibrate(Database& database) const;

  Cell cell_;
  std::shared_ptr<SimulatedCell> simulation_;
  std::vector<size_t> cameras_;
  std::vector<double> positions_;  // with the fixed joints where they stand
  std::vector<size_t> moving_;     // by joint of the grid: its place in positions_
};

}  // namespace silhouette::cell_experiment
