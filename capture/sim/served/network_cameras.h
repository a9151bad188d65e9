// SPDX-License-Identifier: Apache-2.0
// The views of a simulated cell as cameras on the network.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "capture/sim/served/served_views.h"

namespace silhouette {

// The cameras end with it.
class NetworkCameras {
 public:
  virtual ~NetworkCameras() = default;

  // By view: an IP address (GigE Vision), host:port (gRPC) or a URL (RTSP).
  const std::vector<std::string>& addresses() const { return addresses_; }

  // From now on this share of the packets that carry images gets lost; 0 to 1. Only GigE Vision
  // cameras lose packets.
  virtual void LosePackets(double /*share*/) {}

 protected:
  std::vector<std::string> addresses_;
};

// `views` must outlive the cameras of all three.

// GigE Vision cameras: Aravis' simulated camera with rendered images. Camera v is at the loopback
// address 127.0.0.(v + 1); its serial number is the name of the view. Its images are grey, in
// colour or Bayer mosaics, as its client sets. `genicam`: the file that describes the cameras'
// features; empty: Aravis' own. FailedPrecondition: the machine does not have these addresses, or
// something else is at their port. InvalidArgument: a view's name is too long for a serial number.
absl::StatusOr<std::unique_ptr<NetworkCameras>> ServeGigeCameras(ServedViews& views,
                                                                 const std::string& genicam = "");

// A CameraDriverService at 127.0.0.1:port; port 0: a free one. The cameras have the names of the
// views. FailedPrecondition: the port is in use.
absl::StatusOr<std::unique_ptr<NetworkCameras>> ServeGrpcCameras(ServedViews& views, int port);

// RTSP streams of JPEG images (RFC 2435), ten a second, at rtsp://127.0.0.1:port/<view>; port 0: a
// free one. InvalidArgument: an image's sides are not multiples of 8. FailedPrecondition: the port
// is in use.
absl::StatusOr<std::unique_ptr<NetworkCameras>> ServeRtspCameras(ServedViews& views, int port);

}  // namespace silhouette
