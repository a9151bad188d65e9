// SPDX-License-Identifier: Apache-2.0
// What cell.yaml says of the robot's driver.
#pragma once

#include <string>
#include <variant>
#include <vector>

#include "absl/time/time.h"
#include "capture/drivers/robots/simple_message.h"
#include "proto/tls/client_tls_files.h"

namespace silhouette {

// The robot of the simulated cell.
struct SimulatedRobotDriver {};

// A controller that speaks ROS-Industrial's simple_message.
struct SimpleMessageSettings {
  enum class Trajectory {
    kStreaming,  // a way is one point, of sequence number 0
    kDownload,   // a way is a start and an end, executed when the end has been sent
  };

  std::string host = {};
  int motion_port = 11000;
  int state_port = 11002;
  simple_message::ByteOrder byte_order = simple_message::ByteOrder::kLittle;
  std::vector<std::string> joints =
      {};  // in the controller's order, at most simple_message::kMostJoints
  Trajectory trajectory = Trajectory::kStreaming;
  enum class PointMessage {
    kSimple,  // JOINT_TRAJ_PT
    kFull,    // JOINT_TRAJ_PT_FULL
  };
  PointMessage point = PointMessage::kSimple;  // which message points are sent with
  // Share of the joints' greatest speed, for controllers that do not go by the time of a way.
  double velocity = 0.1;
  // Longest time without a message or an answer.
  absl::Duration timeout = absl::Seconds(1);
};

// Somebody's driver behind the RobotDriverService of proto/silhouette/v1/robot_driver.proto.
struct GrpcRobotSettings {
  std::string address = {};  // host:port, or unix:path
  // Longest time without an answer.
  absl::Duration timeout = absl::Seconds(1);
  ClientTlsFiles tls = {};  // without files: plain text
};

// An operator moves the robot as the program asks.
struct ManualRobotSettings {
  // The operator enters the joint values; else a confirmation suffices.
  bool typed = false;
  // Or what its joints are read from; first: nothing.
  std::variant<std::monostate, SimpleMessageSettings, GrpcRobotSettings> read = {};
};

// What moves the robot; std::monostate: no driver is set.
using RobotDriver = std::variant<std::monostate, SimulatedRobotDriver, SimpleMessageSettings,
                                 GrpcRobotSettings, ManualRobotSettings>;

}  // namespace silhouette
