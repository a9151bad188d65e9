// The cameras that a cell's file names.
#pragma once

#include <memory>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "capture/devices/camera_set.h"
#include "tools/cell/devices/simulated.h"

namespace silhouette {

// InvalidArgument, saying what to put where, if a view has no source of images, or two
// have the same camera.
absl::Status CheckCameras(const Cell& cell);

// `simulation` is used by simulated cameras only; null if there are none. Errors: those of
// CheckCameras, and those of a camera that cannot be opened, naming its view.
absl::StatusOr<std::unique_ptr<CameraSet>> OpenCameras(const Cell& cell,
                                                       std::shared_ptr<SimulatedCell> simulation);

}  // namespace silhouette
