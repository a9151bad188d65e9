// SPDX-License-Identifier: Apache-2.0
// The robot and the cameras that a cell's file names, together.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "capture/devices/camera_set.h"
#include "capture/devices/devices.h"
#include "capture/session/travel.h"
#include "db/mask/configuration_grid.h"
#include "tools/cell/cell.h"

namespace silhouette {

struct CellDevices {
  std::unique_ptr<Robot> robot;
  std::unique_ptr<CameraSet> cameras;
};

// For captures. InvalidArgument, saying what to put where, if the file names no driver, no source
// of a view, or what they need is missing. A simulated robot stands at the first configuration that
// is not forbidden, or with its joints near 0 if its images are drawn, with what it carries in
// `variant` (simulation.yaml, `parts`).
absl::StatusOr<CellDevices> OpenDevices(const Cell& cell, const Travel& travel,
                                        const std::string& variant);

// The devices that can be opened, and why the others cannot.
struct AnsweringDevices {
  absl::StatusOr<std::unique_ptr<Robot>> robot;
  std::unique_ptr<CameraSet> cameras;                 // of the views without an error
  std::map<std::string, absl::Status> camera_errors;  // by view
};

// As OpenDevices(), for a look at a cell in which some devices may not answer.
absl::StatusOr<AnsweringDevices> OpenAnsweringDevices(const Cell& cell, const Travel& travel,
                                                      const std::string& variant);

// Opens each device, as often as it is called.
struct CellOpeners {
  std::function<absl::StatusOr<std::unique_ptr<Robot>>()> robot;
  std::function<absl::StatusOr<std::unique_ptr<CameraRig>>()> cameras;
};

// For a server that takes images itself. InvalidArgument as for captures; devices that are not
// simulated are only opened by the functions. All simulated devices are of one cell, in which time
// is real, the robot stands as for a capture, and `obstacles`, a file (capture/sim/obstacles.h),
// are; empty: none.
absl::StatusOr<CellOpeners> OpenersOf(const Cell& cell, const Travel& travel,
                                      const std::string& obstacles);

// The robot alone, to ask it where it is. InvalidArgument: the file names no driver, or a simulated
// robot, which is nowhere without its cell.
absl::StatusOr<std::unique_ptr<Robot>> OpenRobotAlone(const Cell& cell);

// For reference images: the cameras alone. A simulated cell is empty.
absl::StatusOr<std::unique_ptr<CameraSet>> OpenCamerasOfEmptyCell(const Cell& cell);

// For calibration: as for captures, but a simulated robot stays where it is, and boards that are in
// the simulated cell only for calibration are in it.
absl::StatusOr<CellDevices> OpenDevicesForCalibration(const Cell& cell);

// The cameras alone, of the cell as it is. Of a simulated cell: boards that are in it only for
// calibration are there if `all_boards`, and the robot stands at `parked`, or as at the start.
absl::StatusOr<std::unique_ptr<CameraSet>> OpenCamerasOfCell(
    const Cell& cell, bool all_boards, const std::optional<Configuration>& parked = std::nullopt);

}  // namespace silhouette
