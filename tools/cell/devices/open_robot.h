// The robot that a cell's file names.
#pragma once

#include <memory>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "capture/devices/devices.h"
#include "tools/cell/devices/simulated.h"

namespace silhouette {

// InvalidArgument, saying what to put where, if the file names no driver.
absl::Status CheckRobot(const Cell& cell);

// `simulation` is used by a simulated robot only; null if there is none. Errors: those of
// CheckRobot, and those of the robot's connection.
absl::StatusOr<std::unique_ptr<Robot>> OpenRobot(const Cell& cell,
                                                 std::shared_ptr<SimulatedCell> simulation);

}  // namespace silhouette
