// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-sim/serve.h"

#include <iostream>
#include <map>
#include <utility>

#include "absl/strings/str_cat.h"

namespace silhouette {
namespace {

// The share of the packets that a camera loses which drops images.
constexpr double kLostPackets = 0.002;

template <typename Device>
absl::Status ServeAgain(Device& device) {
  absl::StatusOr<std::shared_ptr<void>> server = device.start();
  if (server.ok()) device.server = *std::move(server);
  return server.status();
}

// The device is gone, and comes back where it was.
template <typename Device>
ServedFault Lost(const std::string& name, double seconds, Device& device,
                 std::function<bool()> due) {
  return ServedFault(name, seconds,
                     {.due = std::move(due),
                      .begin =
                          [&device] {
                            device.server.reset();
                            return absl::OkStatus();
                          },
                      .end = [&device] { return ServeAgain(device); }});
}

ServedFault RobotFault(const FaultArguments& arguments, ServedRobot& robot) {
  static const std::map<std::string, ControllerFault> faults = {
      {"stays", ControllerFault::kStaysWhereItIs},
      {"half-way", ControllerFault::kStopsHalfWay},
      {"drifts", ControllerFault::kDrifts},
      {"e-stop", ControllerFault::kTripsOnTheWay}};
  const std::string name = "robot: " + arguments.robot;
  const auto due = [&robot, moves = arguments.after_moves] {
    return robot.controller->moves() >= moves;
  };
  if (arguments.robot == "lost") return Lost(name, arguments.seconds, robot, due);
  const auto set = [&robot](ControllerFault fault) {
    robot.controller->SetFault(fault);
    return absl::OkStatus();
  };
  return ServedFault(name, arguments.seconds,
                     {.due = due,
                      .begin = [set, fault = faults.at(arguments.robot)] { return set(fault); },
                      .end = [set] { return set(ControllerFault::kNone); }});
}

ServedFault CameraFault(const FaultArguments& arguments, ServedCameras& cameras) {
  const std::string name = "cameras: " + arguments.cameras;
  const auto due = [&cameras, images = static_cast<uint64_t>(arguments.after_images)] {
    return cameras.views->sets() >= images;
  };
  if (arguments.cameras == "lost") return Lost(name, arguments.seconds, cameras, due);
  const auto act = [&](std::function<void(bool)> on) {
    return ServedFault(name, arguments.seconds,
                       {.due = due,
                        .begin =
                            [on] {
                              on(true);
                              return absl::OkStatus();
                            },
                        .end =
                            [on] {
                              on(false);
                              return absl::OkStatus();
                            }});
  };
  if (arguments.cameras == "freezes") {
    return act([&cameras](bool frozen) { cameras.views->Freeze(frozen); });
  }
  return act([&cameras](bool drops) {
    cameras.lose_packets(cameras.server.get(), drops ? kLostPackets : 0);
  });
}

}  // namespace

ServedFault::ServedFault(std::string name, double seconds, Acts acts)
    : name_(std::move(name)),
      lasts_(seconds > 0 ? absl::Seconds(seconds) : absl::InfiniteDuration()),
      acts_(std::move(acts)) {}

absl::Status ServedFault::Step(absl::Time now) {
  if (state_ == State::kWaiting && acts_.due()) {
    state_ = State::kOn;
    begun_ = now;
    std::cerr << "fault begins: " << name_ << std::endl;
    return acts_.begin();
  }
  if (state_ == State::kOn && now - begun_ >= lasts_) {
    state_ = State::kOver;
    std::cerr << "fault ends: " << name_ << std::endl;
    return acts_.end();
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
    if (arguments.cameras == "drops" && cameras->lose_packets == nullptr) {
      return absl::InvalidArgumentError("--camera-fault drops needs --cameras gige");
    }
    faults.push_back(CameraFault(arguments, *cameras));
  }
  return faults;
}

}  // namespace silhouette
