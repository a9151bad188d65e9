// Views of a simulated cell as RTSP streams, as network cameras send them.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "capture/sim/served/served_views.h"

namespace silhouette {

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
