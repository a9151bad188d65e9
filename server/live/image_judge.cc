// SPDX-License-Identifier: Apache-2.0
#include "server/live/image_judge.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "common/times/times.h"
#include "server/scene/make_scene.h"

namespace silhouette {

ImageJudge::ImageJudge(const storage::v1::CellDescription& cell, absl::Duration max_age)
    : max_age_(max_age) {
  for (const storage::v1::View& view : cell.views()) {
    views_.push_back({.width = view.image_width(), .height = view.image_height()});
  }
}

absl::StatusOr<Moment> ImageJudge::Judge(size_t view, const CameraImage& image, const Moment& asked,
                                         const Moment& arrived) {
  View& known = views_[view];
  if (image.width != known.width || image.height != known.height) {
    return absl::FailedPreconditionError(absl::StrCat(
        "it gave an image of ", image.width, " x ", image.height, " pixels; the cell says ",
        known.width, " x ", known.height, ": set the camera to that size"));
  }
  const size_t bytes = static_cast<size_t>(image.width) * static_cast<size_t>(image.height) *
                       static_cast<size_t>(image.channels == 3 ? 3 : 1);
  if ((image.channels != 1 && image.channels != 3) || image.pixels.size() != bytes) {
    return absl::InternalError(
        absl::StrCat("it gave ", image.pixels.size(), " bytes, not an image"));
  }
  const Moment stamp = MomentOf(image.captured, asked, arrived);
  const absl::Duration age = arrived.running - stamp.running;
  if (age < -kClockTolerance) {
    return absl::OutOfRangeError(absl::StrCat("its image is stamped ", SpokenTime(-age),
                                              " in the future; let the clocks of camera and "
                                              "server agree"));
  }
  if (age > max_age_) {
    return absl::DeadlineExceededError(
        absl::StrCat("its image was taken ", SpokenTimeAbove(max_age_, age),
                     " ago, longer than max_age, ", SpokenTime(max_age_)));
  }
  const absl::Duration taken = std::min(stamp.running, arrived.running);
  if (taken < known.newest - kClockJitter) {
    return absl::AbortedError(absl::StrCat("its image was taken ", SpokenTime(known.newest - taken),
                                           " before one that came earlier"));
  }
  news_ = news_ || taken > known.newest + kClockJitter;
  known.newest = std::max(taken, known.newest);
  return stamp;
}

bool ImageJudge::TakeNews() {
  const bool news = news_;
  news_ = false;
  return news;
}

}  // namespace silhouette
