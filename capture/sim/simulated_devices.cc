// SPDX-License-Identifier: Apache-2.0
// Robot and cameras of a simulated cell, as capture speaks to them.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "capture/sim/simulated_cell.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

std::vector<std::string> JointNames(const RobotModel& robot) {
  std::vector<std::string> names;
  for (const RobotJoint& joint : robot.joints()) names.push_back(joint.name);
  return names;
}

}  // namespace

SimulatedRobot::SimulatedRobot(std::shared_ptr<SimulatedCell> cell)
    : cell_(std::move(cell)), joints_(JointNames(cell_->robot())) {}

absl::Status SimulatedRobot::MoveTo(std::span<const double> positions) {
  if (positions.size() != joints_.size()) {
    return absl::InvalidArgumentError(
        absl::StrCat("the robot has ", joints_.size(), " joints, not ", positions.size()));
  }
  ASSIGN_OR_RETURN(const std::vector<double> goal, cell_->robot().Positions(joints_, positions));
  const std::vector<double> start = cell_->positions();
  double farthest = 0;
  for (size_t j = 0; j < start.size(); ++j) {
    farthest = std::max(farthest, std::abs(goal[j] - start[j]));
  }
  const double speed = cell_->settings().joint_speed;
  if (speed > 0) {
    constexpr auto kTick = std::chrono::milliseconds(5);
    const double seconds = farthest / speed;
    const auto begin = std::chrono::steady_clock::now();
    std::unique_lock lock(mutex_);
    moving_ = true;
    stopping_ = false;
    double share = 0;
    while (share < 1 && !stop_asked_.wait_for(lock, kTick, [&] { return stopping_; })) {
      const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - begin;
      share = seconds > 0 ? std::min(spent.count() / seconds, 1.0) : 1;
      std::vector<double> now = start;
      for (size_t j = 0; j < now.size(); ++j) now[j] += share * (goal[j] - start[j]);
      cell_->SetPositions(now);
    }
    moving_ = false;
    if (stopping_) return absl::AbortedError("the robot was stopped on the way");
  }
  cell_->SetPositions(goal);
  return absl::OkStatus();
}

absl::StatusOr<RobotState> SimulatedRobot::State() {
  const std::lock_guard lock(mutex_);
  return RobotState{.positions = cell_->positions(), .moving = moving_};
}

absl::Status SimulatedRobot::Stop() {
  const std::lock_guard lock(mutex_);
  stopping_ = true;
  stop_asked_.notify_all();
  return absl::OkStatus();
}

SimulatedCameraRig::SimulatedCameraRig(std::shared_ptr<SimulatedCell> cell,
                                       std::vector<std::string> views, std::vector<size_t> cameras)
    : cell_(std::move(cell)), views_(std::move(views)), cameras_(std::move(cameras)) {}

absl::StatusOr<size_t> CameraOf(const SimulationSettings& settings, const SimulatedView& view) {
  const std::vector<SimulatedCamera>& cameras = settings.cameras;
  const auto camera = std::find_if(cameras.begin(), cameras.end(), [&](const auto& candidate) {
    return candidate.name == view.name;
  });
  if (camera == cameras.end()) {
    return absl::InvalidArgumentError(absl::StrCat(
        "the simulation has no camera for the view '", view.name, "'; it has ",
        absl::StrJoin(cameras, ", ", [](std::string* out, const SimulatedCamera& known) {
          absl::StrAppend(out, "'", known.name, "'");
        })));
  }
  const CameraIntrinsics& image = camera->model.intrinsics();
  if (image.width != view.image_width || image.height != view.image_height) {
    return absl::InvalidArgumentError(absl::StrCat(
        "the view '", view.name, "' has images of ", view.image_width, " x ", view.image_height,
        " pixels in the cell's file, but its simulated camera takes ", image.width, " x ",
        image.height));
  }
  return static_cast<size_t>(camera - cameras.begin());
}

absl::StatusOr<std::vector<size_t>> CamerasOf(const SimulationSettings& settings,
                                              std::span<const SimulatedView> views) {
  std::vector<size_t> cameras;
  for (const SimulatedView& view : views) {
    ASSIGN_OR_RETURN(cameras.emplace_back(), CameraOf(settings, view));
  }
  return cameras;
}

absl::StatusOr<std::unique_ptr<SimulatedCameraRig>> SimulatedCameraRig::Create(
    std::shared_ptr<SimulatedCell> cell, std::span<const SimulatedView> views) {
  ASSIGN_OR_RETURN(auto cameras, CamerasOf(cell->settings(), views));
  std::vector<std::string> names;
  for (const SimulatedView& view : views) names.push_back(view.name);
  return std::unique_ptr<SimulatedCameraRig>(
      new SimulatedCameraRig(std::move(cell), std::move(names), std::move(cameras)));
}

absl::StatusOr<std::vector<CameraImage>> SimulatedCameraRig::Grab() {
  return cell_->TakeImages(cameras_);
}

}  // namespace silhouette
