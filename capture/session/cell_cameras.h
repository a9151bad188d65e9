// SPDX-License-Identifier: Apache-2.0
// The cameras of a cell by the names of its views.
#pragma once

#include <functional>
#include <opencv2/core.hpp>
#include <optional>
#include <set>
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
  // `noisy_views`: see CaptureSettings. InvalidArgument, naming the view, if the rig has no camera
  // for one.
  static absl::StatusOr<CellCameras> Create(const storage::v1::CellDescription& cell,
                                            CameraRig& rig, std::set<std::string> noisy_views);

  // A complete set. A set that does not come (Unavailable, DeadlineExceeded) is asked for again, up
  // to kAttempts times, and reported to `say`. Unavailable, too, if the image of a noisy view is
  // that of the set before. FailedPrecondition, naming the view, if an image has not the size that
  // the cell says; Internal if it is no image.
  absl::StatusOr<ImageSet> Grab(const std::function<void(const std::string&)>& say);

  // When the set was captured that the last Grab() found repeated; nothing: it found none.
  std::optional<absl::Time> repeated() const { return repeated_; }

  static constexpr int kAttempts = 3;

 private:
  struct View {
    std::string name;
    size_t place = 0;  // in the rig
    int width = 0;
    int height = 0;
  };

  explicit CellCameras(CameraRig& rig) : rig_(&rig) {}
  absl::Status CheckLife(const ImageSet& set);

  CameraRig* rig_;
  std::vector<View> views_;
  std::set<std::string> noisy_views_;
  ImageSet last_;
  std::optional<absl::Time> repeated_;
};

}  // namespace silhouette
