// The robot of `silhouette-sim serve`.
#pragma once

#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "capture/sim/served/simulated_controller.h"
#include "tools/silhouette-sim/workplace.h"

namespace silhouette {

// What --robot takes.
inline const std::vector<std::string> kRobotKinds = {"simple_message", "grpc"};

// The robot of a cell as a controller on the network, until it goes.
struct ServedRobot {
  std::unique_ptr<SimulatedController> controller;
  std::shared_ptr<void> server;  // ends before the controller
  // Makes the server anew, where it was.
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

}  // namespace silhouette
