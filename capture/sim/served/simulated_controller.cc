// SPDX-License-Identifier: Apache-2.0
#include "capture/sim/served/simulated_controller.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

constexpr std::chrono::milliseconds kSimulatedControllerTick{2};
// How a robot drifts: its first joint, radians or metres in this time.
constexpr double kDrift = 1;
constexpr absl::Duration kDriftTime = absl::Seconds(4);

}  // namespace

SimulatedController::SimulatedController(const std::shared_ptr<SimulatedCell>& cell)
    : SimulatedController(
          cell->robot(), cell->settings().joint_speed, cell->positions(),
          [cell](std::span<const double> positions) { cell->SetPositions(positions); }) {}

SimulatedController::SimulatedController(RobotModel robot, double joint_speed,
                                         std::vector<double> start, Show show)
    : robot_(std::move(robot)),
      joint_speed_(joint_speed),
      show_(std::move(show)),
      positions_(std::move(start)) {
  for (const RobotJoint& joint : robot_.joints()) joints_.push_back(joint.name);
  thread_ = std::thread([this] { Run(); });
}

SimulatedController::~SimulatedController() {
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

SimulatedController::State SimulatedController::state() const {
  const std::lock_guard lock(mutex_);
  return {.positions = positions_, .moving = moving_, .e_stopped = e_stopped_};
}

absl::Status SimulatedController::Move(std::span<const double> goal, absl::Duration duration) {
  if (goal.size() != joints_.size()) {
    return absl::InvalidArgumentError(
        absl::StrCat("the robot has ", joints_.size(), " joints, not ", goal.size()));
  }
  ASSIGN_OR_RETURN(const auto positions, robot_.Positions(joints_, goal));
  const std::lock_guard lock(mutex_);
  ++moves_;
  if (e_stopped_) return absl::FailedPreconditionError("emergency stop");
  if (fault_ == ControllerFault::kDrifts) return absl::OkStatus();
  way_ = {.start = positions_, .goal = positions, .begin = absl::Now(), .duration = duration};
  double farthest = 0;
  for (size_t j = 0; j < way_.start.size(); ++j) {
    farthest = std::max(farthest, std::abs(way_.goal[j] - way_.start[j]));
  }
  if (joint_speed_ > 0) {
    way_.duration = std::max(way_.duration, absl::Seconds(farthest / joint_speed_));
  }
  if (fault_ == ControllerFault::kTooFast) way_.duration /= 10;
  if (fault_ == ControllerFault::kStopsHalfWay) way_.last_share = 0.5;
  if (fault_ == ControllerFault::kTripsOnTheWay) {
    way_.last_share = 0.5;
    way_.trips = true;
  }
  moving_ = fault_ != ControllerFault::kStaysWhereItIs;
  changed_.notify_all();
  return absl::OkStatus();
}

void SimulatedController::Stop() {
  const std::lock_guard lock(mutex_);
  moving_ = false;
  ++stops_;
}

void SimulatedController::SetFault(ControllerFault fault) {
  const std::lock_guard lock(mutex_);
  fault_ = fault;
  e_stopped_ = fault == ControllerFault::kEmergencyStop;
  if (fault != ControllerFault::kDrifts) return;
  way_ = {.start = positions_, .goal = positions_, .begin = absl::Now(), .duration = kDriftTime};
  way_.goal[0] += kDrift;
  moving_ = true;
  changed_.notify_all();
}

int SimulatedController::moves() const {
  const std::lock_guard lock(mutex_);
  return moves_;
}

int SimulatedController::stops() const {
  const std::lock_guard lock(mutex_);
  return stops_;
}

void SimulatedController::Step() {
  const absl::Duration spent = absl::Now() - way_.begin;
  const double share =
      std::min(way_.duration > absl::ZeroDuration() ? absl::FDivDuration(spent, way_.duration) : 1,
               way_.last_share);
  std::vector<double> now = way_.start;
  for (size_t j = 0; j < now.size(); ++j) now[j] += share * (way_.goal[j] - way_.start[j]);
  positions_ = share == 1 ? way_.goal : now;
  show_(positions_);
  if (share < way_.last_share) return;
  moving_ = false;
  if (way_.trips) e_stopped_ = true;
}

void SimulatedController::Run() {
  std::unique_lock lock(mutex_);
  while (!ending_) {
    changed_.wait(lock, [&] { return moving_ || ending_; });
    if (moving_) Step();
    changed_.wait_for(lock, kSimulatedControllerTick, [&] { return ending_; });
  }
}

}  // namespace silhouette
