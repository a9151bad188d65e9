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

}  // namespace silhouette
