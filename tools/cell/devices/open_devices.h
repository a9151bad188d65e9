// SPDX-License-Identifier: Apache-2.0
// The simulated cell of a cell's file, for devices that are simulated in process.
#pragma once

#include <map>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "capture/devices/camera_set.h"
#include "capture/devices/devices.h"
#include "capture/sim/simulated_cell.h"
#include "tools/cell/cell.h"

namespace silhouette {

bool HasSimulatedRobot(const Cell& cell);
bool HasSimulatedCamera(const Cell& cell);

// With the robot as it is in a variant. InvalidArgument, saying what to put where, if
// the file names no simulation or no model of the robot, or if one of them cannot be read.
absl::StatusOr<std::shared_ptr<SimulatedCell>> LoadSimulatedCell(
    const Cell& cell, const std::string& variant = kBareVariant);

// InvalidArgument with the cell's file in front.
absl::Status CellMistake(const Cell& cell, const std::string& what);

// The cameras that a cell's file names.

// InvalidArgument, saying what to put where, if a view has no source of images, or two
// have the same camera.
absl::Status CheckCameras(const Cell& cell);

// By view: why its camera cannot be opened.
using CameraErrors = std::map<std::string, absl::Status>;

// `simulation` is used by simulated cameras only; null if there are none. Errors: those of
// CheckCameras, and that of the first camera that cannot be opened, naming its view. With `errors`
// these go there instead, and the set has no such views.
absl::StatusOr<std::unique_ptr<CameraSet>> OpenCameras(const Cell& cell,
                                                       std::shared_ptr<SimulatedCell> simulation,
                                                       CameraErrors* errors = nullptr);

// The robot that a cell's file names.

// InvalidArgument, saying what to put where, if the file names no driver.
absl::Status CheckRobot(const Cell& cell);

// `simulation` is used by a simulated robot only; null if there is none. Errors: those of
// CheckRobot, and those of the robot's connection.
absl::StatusOr<std::unique_ptr<Robot>> OpenRobot(const Cell& cell,
                                                 std::shared_ptr<SimulatedCell> simulation);

}  // namespace silhouette
