// SPDX-License-Identifier: Apache-2.0
// ManualRobot: a robot that an operator moves with its pendant, as the program asks.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "capture/devices/devices.h"

namespace silhouette {

// The person who moves the robot.
struct Operator {
  std::function<void(const std::string& line)> tell;
  // His answer, a line; an error: he is gone, or wants to stop.
  std::function<absl::StatusOr<std::string>(const std::string& question)> ask;
};

struct ManualJoint {
  std::string name;
  bool prismatic = false;   // shown in millimetres, else in degrees
  bool continuous = false;  // full turns do not count
};

class ManualRobot : public Robot {
 public:
  // How it is known where the robot is.
  enum class Reading {
    kConfirmed,  // the operator confirms the position, or enters the joint values
    kTyped,      // the operator enters the joint values
  };

  ManualRobot(std::vector<ManualJoint> joints, Operator person, Reading reading);
  // Joints are read from `reader`, whose joints these are; the operator sees the
  // deviation until it is at most `tolerance`, radians and metres.
  ManualRobot(std::vector<ManualJoint> joints, Operator person, std::unique_ptr<Robot> reader,
              double tolerance);

  const std::vector<std::string>& joints() const override { return names_; }
  // Cancelled: the operator wants to stop.
  absl::Status MoveTo(std::span<const double> positions) override;
  // Asks the operator where the robot stands if that is not known yet.
  absl::StatusOr<RobotState> State() override;
  // Tells the operator.
  absl::Status Stop() override;

 private:
  // "joint_1 30.00 deg, rail 120.0 mm" of all joints, or of those that differ from `known`.
  std::string Spoken(std::span<const double> positions,
                     const std::optional<std::vector<double>>& known) const;
  // His answer; Cancelled if it is "stop".
  absl::StatusOr<std::string> Ask(const std::string& question) const;
  absl::StatusOr<std::vector<double>> AskForPositions(const std::string& question,
                                                      std::span<const double> if_confirmed) const;
  absl::Status WaitUntilThere(std::span<const double> goal);

  const std::vector<ManualJoint> joints_;
  std::vector<std::string> names_;
  const Operator person_;
  const Reading reading_ = Reading::kConfirmed;
  const std::unique_ptr<Robot> reader_;  // may be null
  const double tolerance_ = 0;
  std::optional<std::vector<double>> at_;
};

// The operator at the terminal that the program runs in.

// Lines and questions go to stderr, answers come from stdin. What was typed at a terminal before a
// question does not answer it. `stopped`: asked ten times a second; empty: never.
// FailedPrecondition: stdin has ended; Cancelled: `stopped` is true, or a signal came, such as that
// of Ctrl-C where the program catches it.
Operator OperatorAtTerminal(std::function<bool()> stopped = nullptr);

}  // namespace silhouette
