// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-sim/serve.h"

#include <iostream>
#include <map>
#include <utility>

#include "absl/strings/str_cat.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

// The share of the packets that a camera loses which drops images.
constexpr double kLostPackets = 0.002;

// Ends the device's server, or starts it again at the same address.
template <typename Device>
absl::Status Lose(Device& device, bool lost) {
  device.server.reset();
  if (!lost) {
    ASSIGN_OR_RETURN(device.server, device.start());
  }
  return absl::OkStatus();
}

ServedFault RobotFault(const FaultArguments& arguments, ServedRobot& robot) {
  static const std::map<std::string, ControllerFault> faults = {
      {"stays", ControllerFault::kStaysWhereItIs},
      {"half-way", ControllerFault::kStopsHalfWay},
      {"drifts", ControllerFault::kDrifts},
      {"e-stop", ControllerFault::kTripsOnTheWay}};
  return {"robot: " + arguments.robot, arguments.seconds,
          [&robot, moves = arguments.after_moves] { return robot.controller->moves() >= moves; },
          [&robot, kind = arguments.robot](bool on) {
            if (kind == "lost") return Lose(robot, on);
            robot.controller->SetFault(on ? faults.at(kind) : ControllerFault::kNone);
            return absl::OkStatus();
          }};
}

ServedFault CameraFault(const FaultArguments& arguments, ServedCameras& cameras) {
  return {"cameras: " + arguments.cameras, arguments.seconds,
          [&cameras, images = static_cast<uint64_t>(arguments.after_images)] {
            return cameras.views->sets() >= images;
          },
          [&cameras, kind = arguments.cameras](bool on) {
            if (kind == "lost") return Lose(cameras, on);
            if (kind == "freezes") {
              cameras.views->Freeze(on);
            } else {
              cameras.server->LosePackets(on ? kLostPackets : 0);
            }
            return absl::OkStatus();
          }};
}

}  // namespace

ServedFault::ServedFault(std::string name, double seconds, std::function<bool()> due,
                         std::function<absl::Status(bool)> set)
    : name_(std::move(name)),
      lasts_(seconds > 0 ? absl::Seconds(seconds) : absl::InfiniteDuration()),
      due_(std::move(due)),
      set_(std::move(set)) {}

absl::Status ServedFault::Step(absl::Time now) {
  if (state_ == State::kWaiting && due_()) {
    state_ = State::kOn;
    begun_ = now;
    std::cerr << "fault begins: " << name_ << std::endl;
    return set_(true);
  }
  if (state_ == State::kOn && now - begun_ >= lasts_) {
    state_ = State::kOver;
    std::cerr << "fault ends: " << name_ << std::endl;
    return set_(false);
  }
  return absl::OkStatus();
}

absl::StatusOr<std::vector<ServedFault>> FaultsOf(const FaultArguments& arguments,
                                                  ServedRobot* robot, ServedCameras* cameras) {
  std::vector<ServedFault> faults;
  if (!arguments.robot.empty()) {
    if (robot == nullptr) return absl::InvalidArgumentError("--robot-fault needs --robot");
    faults.push_back(RobotFault(arguments, *robot));
  }
  if (!arguments.cameras.empty()) {
    if (cameras == nullptr) return absl::InvalidArgumentError("--camera-fault needs --cameras");
    if (arguments.cameras == "drops" && !cameras->loses_packets) {
      return absl::InvalidArgumentError("--camera-fault drops needs --cameras gige");
    }
    faults.push_back(CameraFault(arguments, *cameras));
  }
  return faults;
}

}  // namespace silhouette
