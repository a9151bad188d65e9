// The robot and the cameras that the cell's file names.
#pragma once

#include <memory>

#include "absl/status/statusor.h"
#include "capture/devices.h"
#include "capture/travel.h"
#include "tools/cell/cell.h"

namespace silhouette {

struct CellDevices {
  std::unique_ptr<Robot> robot;
  std::unique_ptr<CameraRig> cameras;
};

// For captures. InvalidArgument, saying what to put where, if the file names no driver, no source
// of a view, or what they need is missing. A simulated robot stands at the first configuration that
// is not forbidden.
absl::StatusOr<CellDevices> OpenDevices(const Cell& cell, const Travel& travel);

// For reference images: the cameras alone. A simulated cell is empty.
absl::StatusOr<std::unique_ptr<CameraRig>> OpenCamerasOfEmptyCell(const Cell& cell);

// For calibration: as for captures, but a simulated robot stays where it is, and boards that are in
// the simulated cell only for calibration are in it.
absl::StatusOr<CellDevices> OpenDevicesForCalibration(const Cell& cell);

}  // namespace silhouette
