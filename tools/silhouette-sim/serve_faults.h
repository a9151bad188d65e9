// What goes wrong with the devices of `silhouette-sim serve`, and when.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "tools/silhouette-sim/serve_cameras.h"
#include "tools/silhouette-sim/serve_robot.h"

namespace silhouette {

// What --robot-fault and --camera-fault take.
inline const std::vector<std::string> kRobotFaults = {"stays", "half-way", "drifts", "e-stop",
                                                      "lost"};
inline const std::vector<std::string> kCameraFaults = {"lost", "drops", "freezes"};

struct FaultArguments {
  std::string robot;      // of kRobotFaults; empty: none
  int after_moves = 10;   // that the robot was told to make
  std::string cameras;    // of kCameraFaults; empty: none
  int after_images = 10;  // of each camera
  double seconds = 0;     // how long they last; 0: for good
};

// A fault of one device: begins when its time has come, and ends `seconds` later.
class ServedFault {
 public:
  struct Acts {
    std::function<bool()> due;
    std::function<absl::Status()> begin;
    std::function<absl::Status()> end;
  };
  // `name`: "robot: lost" and the like.
  ServedFault(std::string name, double seconds, Acts acts);

  // Begins or ends it if it is time, and says so to standard error. Errors: those of `begin`,
  // `end`.
  absl::Status Step(absl::Time now);

 private:
  enum class State { kWaiting, kOn, kOver };

  const std::string name_;
  const absl::Duration lasts_;
  const Acts acts_;
  State state_ = State::kWaiting;
  absl::Time begun_;
};

// The faults that were asked for. InvalidArgument: of a device that is not served, or that cannot
// have it. The devices must outlive them.
absl::StatusOr<std::vector<ServedFault>> FaultsOf(const FaultArguments& arguments,
                                                  ServedRobot* robot, ServedCameras* cameras);

}  // namespace silhouette
