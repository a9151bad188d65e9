// SPDX-License-Identifier: Apache-2.0
// Views of a simulated cell as GigE Vision cameras: Aravis' simulated camera, with rendered images.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "capture/sim/served/served_views.h"

namespace silhouette {

// The cameras end with it.
class GigeCameras {
 public:
  // Camera v is at the loopback address 127.0.0.(v + 1); its serial number is the name of the view.
  // Its images are grey, in colour or Bayer mosaics, as it is told. `genicam`: the file that says
  // what the cameras can be told; empty: Aravis' own. `views` must outlive it. FailedPrecondition:
  // the machine has not these addresses, or something else is at their port. InvalidArgument: a
  // view's name is too long for a serial number.
  static absl::StatusOr<std::unique_ptr<GigeCameras>> Start(ServedViews& views,
                                                            const std::string& genicam = "");
  virtual ~GigeCameras() = default;

  // From now on so large a share of the packets with which images are sent gets lost; 0 to 1.
  virtual void LosePackets(double share) = 0;

  // By view.
  virtual std::vector<std::string> addresses() const = 0;
};

// Views of a simulated cell behind a CameraDriverService.

// The service ends with it.
class GrpcCameras {
 public:
  // At 127.0.0.1:port; port 0: a free one. The cameras have the names of the views. `views` must
  // outlive it. FailedPrecondition: the port is in use.
  static absl::StatusOr<std::unique_ptr<GrpcCameras>> Start(ServedViews& views, int port);
  virtual ~GrpcCameras() = default;

  virtual const std::string& address() const = 0;
};

// Views of a simulated cell as RTSP streams, as network cameras send them.

// The streams end with it.
class RtspCameras {
 public:
  // Streams of JPEG images (RFC 2435), ten a second, at rtsp://127.0.0.1:port/<view>; port 0: a
  // free one. `views` must outlive it. InvalidArgument: an image's sides are not multiples of 8.
  // FailedPrecondition: the port is in use.
  static absl::StatusOr<std::unique_ptr<RtspCameras>> Start(ServedViews& views, int port);
  virtual ~RtspCameras() = default;

  // By view.
  virtual std::vector<std::string> urls() const = 0;
};

}  // namespace silhouette
