// SPDX-License-Identifier: Apache-2.0
// Cameras behind somebody's own CameraDriverService (proto/silhouette/v1/camera_driver.proto).
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "capture/devices/devices.h"
#include "proto/tls/client_tls_files.h"
#include "silhouette/v1/camera_driver.pb.h"

namespace silhouette {

// The view of the cell that a camera of the service takes images of.
struct GrpcView {
  std::string view;
  std::string camera;  // its name there
  int width = 0;
  int height = 0;
};

// All of `views` are grabbed by one call, which takes `timeout` at most. `tls`: without files,
// plain text; InvalidArgument, NotFound: as ChannelCredentialsFor. Unavailable: no server answers
// at the address. NotFound: there is no such camera; FailedPrecondition: its images have another
// size than the view says.
absl::StatusOr<std::unique_ptr<CameraSource>> OpenGrpcCameras(const std::string& address,
                                                              const std::vector<GrpcView>& views,
                                                              absl::Duration timeout,
                                                              const ClientTlsFiles& tls = {});

// The image in a driver's message, taken at `captured`. DataLoss: the message has none, or one that
// cannot be.
absl::StatusOr<CameraImage> ImageOf(const v1::DriverImage& message, absl::Time captured);

}  // namespace silhouette
