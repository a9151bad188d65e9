// CameraSource: a camera, or several that are read together, as CameraSet triggers and reads them.
#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "capture/devices/devices.h"

namespace silhouette {

// Need not be thread-safe, but may be opened, triggered and destroyed by another thread. Trigger()
// and Wait() take turns.
// Messages do not name the view of a source that has only one: whoever asks knows it.
class CameraSource {
 public:
  virtual ~CameraSource() = default;

  // The views that it takes images of.
  virtual const std::vector<std::string>& views() const = 0;

  // How long its images may take, once all sources of a set have been triggered.
  virtual absl::Duration timeout() const = 0;

  // Whether the device is there, for all that is known. If not, Open() comes before Trigger().
  virtual bool ready() const { return true; }

  // Tries to reach a device that was lost, with all settings, which may take seconds: those of
  // several sources are reached at the same time. Unavailable: it is still not there.
  virtual absl::Status Open() { return absl::OkStatus(); }

  // Asks for one image of every view and returns without waiting for any. Unavailable: the device
  // is not there, or no longer.
  virtual absl::Status Trigger() = 0;

  // The images, in the order of views(). None of them was taken before Trigger(); `captured` is the
  // earliest moment at which each can have been taken, by this machine's clock. DeadlineExceeded:
  // an image did not come. DataLoss: it is not whole. Unavailable: the device is not there any
  // more. OutOfRange: the recording has no more images. After an error the source is as ready as
  // after a success.
  virtual absl::StatusOr<std::vector<CameraImage>> Wait(absl::Time deadline) = 0;
};

}  // namespace silhouette
