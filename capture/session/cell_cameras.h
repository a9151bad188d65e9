// SPDX-License-Identifier: Apache-2.0
// The cameras of a cell by the names of its views.
#pragma once

#include <functional>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "capture/devices/devices.h"
#include "silhouette/storage/v1/storage.pb.h"

namespace silhouette {

// One image per view, in the order of the cell description; 8 bits, grey or blue, green, red.
struct ImageSet {
  std::vector<cv::Mat> images;
  absl::Time captured;  // when the oldest was taken
};

// The rig must outlive it.
class CellCameras {
 public:
  // InvalidArgument, naming the view, if the rig has no camera for one.
  static absl::StatusOr<CellCameras> Create(const storage::v1::CellDescription& cell,
                                            CameraRig& rig);

  // A complete set. A set that does not come (Unavailable, DeadlineExceeded) is asked for again, up
  // to kAttempts times, and reported to `say`. FailedPrecondition, naming the view, if an image has
  // not the size that the cell says; Internal if it is no image.
  absl::StatusOr<ImageSet> Grab(const std::function<void(const std::string&)>& say);

  static constexpr int kAttempts = 3;

 private:
  struct View {
    std::string name;
    size_t place = 0;  // in the rig
    int width = 0;
    int height = 0;
  };

  explicit CellCameras(CameraRig& rig) : rig_(&rig) {}

  CameraRig* rig_;
  std::vector<View> views_;
};

}  // namespace silhouette
