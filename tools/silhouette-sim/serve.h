// SPDX-License-Identifier: Apache-2.0
// The robot of `silhouette-sim serve`.
#pragma once

#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "capture/sim/served/network_cameras.h"
#include "capture/sim/served/served_views.h"
#include "capture/sim/served/simulated_controller.h"
#include "capture/sim/simulated_cell.h"
#include "tools/silhouette-sim/workplace.h"

namespace silhouette {

// What --robot takes.
inline const std::vector<std::string> kRobotKinds = {"simple_message", "grpc"};

// The robot of a cell as a controller on the network, until it goes.
struct ServedRobot {
  std::unique_ptr<SimulatedController> controller;
  std::shared_ptr<void> server;  // ends before the controller
  // Starts the server again at the same address.
  std::function<absl::StatusOr<std::shared_ptr<void>>()> start;
  nlohmann::ordered_json told;  // where it is
};

// `kind` of kRobotKinds. `address`: "host:port" or "host"; simple_message listens there for motion
// and two ports further for the state. Empty: 127.0.0.1 and the ports of the cell's file, or 50061.
// InvalidArgument: it is no address, or the cell's file names other joints. Other errors: those of
// the servers of capture/sim/served.
absl::StatusOr<ServedRobot> ServeRobot(const Workplace& workplace, const std::string& kind,
                                       const std::string& address,
                                       const std::shared_ptr<SimulatedCell>& simulation);

// The cameras of `silhouette-sim serve`.

// What --cameras takes.
inline const std::vector<std::string> kCameraKinds = {"gige", "grpc", "rtsp"};

// The views of a cell as cameras on the network, until it goes.
struct ServedCameras {
  std::unique_ptr<ServedViews> views;
  std::unique_ptr<NetworkCameras> server;  // ends before the views
  // Starts the server again at the same address.
  std::function<absl::StatusOr<std::unique_ptr<NetworkCameras>>()> start;
  bool loses_packets = false;  // NetworkCameras::LosePackets has an effect
  nlohmann::ordered_json told = nlohmann::ordered_json::array();  // where they are
};

// All views of the cell's file, whatever it says of their sources; `kind` of kCameraKinds. Port: of
// rtsp and grpc; 0: a free one. Errors: those of the servers of capture/sim/served.
absl::StatusOr<ServedCameras> ServeCameras(const Workplace& workplace, const std::string& kind,
                                           int port,
                                           const std::shared_ptr<SimulatedCell>& simulation);

// What goes wrong with the devices of `silhouette-sim serve`, and when.

// What --robot-fault and --camera-fault take.
inline const std::vector<std::string> kRobotFaults = {"stays", "half-way", "drifts", "e-stop",
                                                      "lost"};
inline const std::vector<std::string> kCameraFaults = {"lost", "drops", "freezes"};

struct FaultArguments {
  std::string robot;      // of kRobotFaults; empty: none
  int after_moves = 10;   // move commands to the robot
  std::string cameras;    // of kCameraFaults; empty: none
  int after_images = 10;  // of each camera
  double seconds = 0;     // how long they last; 0: for good
};

// A fault of one device: begins when its time has come, and ends `seconds` later.
class ServedFault {
 public:
  // `name`: "robot: lost" and the like. `due`: whether it is time to begin. `set`: begins the fault
  // (true) or ends it.
  ServedFault(std::string name, double seconds, std::function<bool()> due,
              std::function<absl::Status(bool on)> set);

  // Begins or ends it if it is time, and reports that on standard error. Errors: those of `set`.
  absl::Status Step(absl::Time now);

 private:
  enum class State { kWaiting, kOn, kOver };

  const std::string name_;
  const absl::Duration lasts_;
  const std::function<bool()> due_;
  const std::function<absl::Status(bool)> set_;
  State state_ = State::kWaiting;
  absl::Time begun_;
};

// The faults that were asked for. InvalidArgument: of a device that is not served, or that cannot
// have it. The devices must outlive them.
absl::StatusOr<std::vector<ServedFault>> FaultsOf(const FaultArguments& arguments,
                                                  ServedRobot* robot, ServedCameras* cameras);

}  // namespace silhouette
