// Views of a simulated cell behind a CameraDriverService.
#pragma once

#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "capture/sim/served/served_views.h"

namespace silhouette {

// The service ends with it.
class GrpcCameras {
 public:
  // At 127.0.0.1:port; port 0: a free one. The cameras have the names of the views. `views` must
  // outlive it. FailedPrecondition: the port is in use.
  static absl::StatusOr<std::unique_ptr<GrpcCameras>> Start(ServedViews& views, int port);
  virtual ~GrpcCameras() = default;

  virtual const std::string& address() const = 0;
};

}  // namespace silhouette
