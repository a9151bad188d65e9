// SPDX-License-Identifier: Apache-2.0
// GigE Vision and USB3 Vision cameras, through Aravis.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "capture/devices/camera_settings.h"
#include "capture/devices/devices.h"

namespace silhouette {

// A camera that answered when all were called.
struct FoundCamera {
  std::string protocol;  // "GigEVision", "USB3Vision"
  std::string vendor;
  std::string model;
  std::string serial;
  std::string address;  // of a GigE camera
};

// Calls all cameras of the local networks and of USB; takes about a second.
std::vector<FoundCamera> FindGenicamCameras();

// A camera with images of width x height: of its region if that has this size, else from the top
// left of its sensor. Unavailable: it does not answer, or another program controls it.
// FailedPrecondition: it does not take the size, trigger, exposure or gain; the message says what
// it takes.
//
// Triggered by software an image's `captured` is the time just before the trigger was sent; else it
// is `latency` before the image's first packet came. When the connection is lost, Open()
// makes it again, with all settings.
absl::StatusOr<std::unique_ptr<CameraSource>> OpenGenicamCamera(const std::string& view, int width,
                                                                int height,
                                                                const GenicamSource& source);

}  // namespace silhouette
