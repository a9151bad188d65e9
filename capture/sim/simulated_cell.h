// SPDX-License-Identifier: Apache-2.0
// SimulatedCell: robot, obstacles, light and cameras in one process, and the devices through which
// capture speaks to them as to a real cell.
#pragma once

#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "calib/robot/robot_model.h"
#include "capture/devices/devices.h"
#include "capture/sim/image_sensor.h"
#include "capture/sim/obstacles.h"
#include "capture/sim/renderer.h"
#include "capture/sim/simulation.h"

namespace silhouette {

// Thread-safe. Time is simulated: seconds, 0 at the start; every set of images takes it forward by
// frame_interval, unless it runs in real time. A set of images shows one instant, its capture time.
class SimulatedCell {
 public:
  // All joints at 0, or at the limit nearest to it; no obstacles. Throws std::invalid_argument if a
  // board is on a link that the robot does not have.
  SimulatedCell(RobotModel robot, SimulationSettings settings);

  // Reads simulation.yaml; the robot carries what it does in `variant`.
  static absl::StatusOr<std::shared_ptr<SimulatedCell>> Load(
      const std::string& simulation, const RobotModel& bare,
      const std::string& variant = kBareVariant);

  const RobotModel& robot() const { return robot_; }
  const SimulationSettings& settings() const { return settings_; }

  // In the order of robot().joints().
  std::vector<double> positions() const;
  // Puts the robot there at once. Throws std::invalid_argument if there are more or fewer values
  // than joints.
  void SetPositions(std::span<const double> positions);

  // Takes the robot out of the cell, e.g. for reference images, or puts it back.
  void SetRobotPresent(bool present);

  void SetObstacles(std::vector<Obstacle> obstacles);

  // Whether boards that are there only for calibration (SimulatedBoard::always) are in the cell; at
  // first they are not.
  void ShowAllBoards(bool show);
  // Holds a board somewhere, whatever the settings say of its place; nothing: takes it away. Throws
  // std::invalid_argument if there is no board of the name.
  void HoldBoard(const std::string& name, const std::optional<Eigen::Isometry3d>& world_from_board);
  // Where the boards of settings().boards are, in the world; nothing: not in the cell.
  std::vector<std::optional<Eigen::Isometry3d>> BoardPoses() const;

  double time() const;
  void SetTime(double seconds);
  // From now on time passes as it does for everybody, and images do not take it forward.
  void RunInRealTime();

  // The number of the next set of images; noise depends on it.
  void SetFrame(uint64_t frame);

  // One simultaneous set: an image for each of `cameras`, indices of settings().cameras.
  std::vector<CameraImage> TakeImages(std::span<const size_t> cameras);

  // What the images show: for each of `cameras`, what is seen in the middle of every pixel, row by
  // row. Neither time nor the number of the next set go on.
  std::vector<std::vector<Seen>> TrueImages(std::span<const size_t> cameras);

 private:
  // What HoldBoard said of a board, if anything.
  struct Hold {
    bool held = false;
    std::optional<Eigen::Isometry3d> pose;
  };

  std::vector<std::optional<Eigen::Isometry3d>> BoardPosesWith(const Poses& links) const;
  // The cell as images show it.
  struct Instant {
    absl::Time captured;
    double time = 0;
    uint64_t frame = 0;
    Poses robot;
    bool robot_present = true;
    std::vector<std::optional<Eigen::Isometry3d>> boards;
    Poses obstacles;
  };
  // Takes time and the number of the next set forward, if `go_on`.
  Instant InstantNow(bool go_on);
  // With the renderer's mutex held.
  void Render(std::span<const size_t> cameras, const Instant& instant,
              const Renderer::RowSink& sink);
  double Now() const;  // with the mutex held

  const RobotModel robot_;
  const SimulationSettings settings_;
  const ImageSensor sensor_;

  // Taken before the other mutex, where both are: the robot moves on while images are rendered.
  std::mutex renderer_mutex_;
  Renderer renderer_;

  mutable std::mutex mutex_;  // guards all below
  std::vector<double> positions_;
  bool robot_present_ = true;
  bool all_boards_ = false;
  std::vector<Hold> holds_;  // by board
  std::vector<Obstacle> obstacles_;
  double time_ = 0;
  // When time_ was set, if time passes by itself.
  std::optional<std::chrono::steady_clock::time_point> real_time_;
  uint64_t frame_ = 0;
};

// The robot of a simulated cell; it jumps, or moves at the cell's joint_speed in real time.
class SimulatedRobot : public Robot {
 public:
  explicit SimulatedRobot(std::shared_ptr<SimulatedCell> cell);

  const std::vector<std::string>& joints() const override { return joints_; }
  // Aborted: it was stopped on the way.
  absl::Status MoveTo(std::span<const double> positions) override;
  absl::StatusOr<RobotState> State() override;
  absl::Status Stop() override;

 private:
  const std::shared_ptr<SimulatedCell> cell_;
  std::vector<std::string> joints_;
  std::mutex mutex_;
  std::condition_variable stop_asked_;
  bool moving_ = false;  // guarded by mutex_
  bool stopping_ = false;
};

// A view as cell.yaml has it.
struct SimulatedView {
  std::string name;  // of a camera of the simulation
  int image_width = 0;
  int image_height = 0;
};

// The camera that takes a view's images, as index of settings.cameras. InvalidArgument: there is no
// camera of its name, or it has not the view's image size.
absl::StatusOr<size_t> CameraOf(const SimulationSettings& settings, const SimulatedView& view);
absl::StatusOr<std::vector<size_t>> CamerasOf(const SimulationSettings& settings,
                                              std::span<const SimulatedView> views);

// Cameras of a simulated cell.
class SimulatedCameraRig : public CameraRig {
 public:
  // InvalidArgument: a view has no camera of its name, or not the camera's image size.
  static absl::StatusOr<std::unique_ptr<SimulatedCameraRig>> Create(
      std::shared_ptr<SimulatedCell> cell, std::span<const SimulatedView> views);

  const std::vector<std::string>& views() const override { return views_; }
  absl::StatusOr<std::vector<CameraImage>> Grab() override;

 private:
  SimulatedCameraRig(std::shared_ptr<SimulatedCell> cell, std::vector<std::string> views,
                     std::vector<size_t> cameras);

  const std::shared_ptr<SimulatedCell> cell_;
  const std::vector<std::string> views_;
  const std::vector<size_t> cameras_;  // by view
};

}  // namespace silhouette
