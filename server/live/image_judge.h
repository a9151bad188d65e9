// SPDX-License-Identifier: Apache-2.0
// Whether an image is one that a scene can be made of.
#pragma once

#include <optional>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "capture/devices/devices.h"
#include "server/scene/clock.h"
#include "silhouette/storage/v1/storage.pb.h"

namespace silhouette {

// Remembers the images that it let pass. Not thread-safe.
class ImageJudge {
 public:
  // `max_age`: of SceneSettings.
  ImageJudge(const storage::v1::CellDescription& cell, absl::Duration max_age);

  // An image of a view of the cell that was asked for at `asked` and had arrived by `arrived`:
  // when it was taken by its stamp, which may be ahead of `arrived` by kClockTolerance.
  // FailedPrecondition: it has not the size that the cell says. Internal: it is no image.
  // OutOfRange: it was taken in the future. DeadlineExceeded: too long ago. Aborted: before one
  // that was let pass.
  absl::StatusOr<Moment> Judge(size_t view, const CameraImage& image, const Moment& asked,
                               const Moment& arrived);

  // Whether a view that was judged since the last call was let pass and is newer than before.
  bool TakeNews();

 private:
  struct View {
    int width = 0;
    int height = 0;
    absl::Duration newest = -absl::InfiniteDuration();  // running clock
  };

  const absl::Duration max_age_;
  std::vector<View> views_;
  bool news_ = false;
};

}  // namespace silhouette
