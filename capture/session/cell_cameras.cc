// SPDX-License-Identifier: Apache-2.0
#include "capture/session/cell_cameras.h"

#include <algorithm>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "capture/session/image_change.h"
#include "db/status/status_macros.h"

namespace silhouette {

absl::StatusOr<CellCameras> CellCameras::Create(const storage::v1::CellDescription& cell,
                                                CameraRig& rig, std::set<std::string> noisy_views) {
  CellCameras cameras(rig);
  cameras.noisy_views_ = std::move(noisy_views);
  const std::vector<std::string>& known = rig.views();
  for (const storage::v1::View& view : cell.views()) {
    const auto place = std::find(known.begin(), known.end(), view.name());
    if (place == known.end()) {
      return absl::InvalidArgumentError(
          absl::StrCat("there is no camera for the view '", view.name(), "'; there are ",
                       known.empty() ? "none" : absl::StrJoin(known, ", ")));
    }
    cameras.views_.push_back({.name = view.name(),
                              .place = static_cast<size_t>(place - known.begin()),
                              .width = view.image_width(),
                              .height = view.image_height()});
  }
  return cameras;
}

absl::StatusOr<ImageSet> CellCameras::Grab(const std::function<void(const std::string&)>& say) {
  repeated_.reset();
  absl::StatusOr<std::vector<CameraImage>> grabbed;
  for (int attempt = 1; attempt <= kAttempts; ++attempt) {
    grabbed = rig_->Grab();
    const absl::Status& status = grabbed.status();
    if (!absl::IsUnavailable(status) && !absl::IsDeadlineExceeded(status)) break;
    if (attempt < kAttempts) say(absl::StrCat("images asked for again: ", status.message()));
  }
  if (!grabbed.ok()) return grabbed.status();
  if (grabbed->size() != rig_->views().size()) {
    return absl::InternalError(absl::StrCat("the cameras gave ", grabbed->size(), " images for ",
                                            rig_->views().size(), " views"));
  }
  ImageSet set{.images = {}, .captured = absl::InfiniteFuture()};
  for (const View& view : views_) {
    CameraImage& image = (*grabbed)[view.place];
    if (image.width != view.width || image.height != view.height) {
      return absl::FailedPreconditionError(
          absl::StrCat("the camera of the view '", view.name, "' gave an image of ", image.width,
                       " x ", image.height, " pixels; the cell says ", view.width, " x ",
                       view.height, ": set the camera to that size, or correct image_size"));
    }
    const bool colour = image.channels == 3;
    if ((!colour && image.channels != 1) ||
        image.pixels.size() != static_cast<size_t>(image.width) *
                                   static_cast<size_t>(image.height) *
                                   static_cast<size_t>(image.channels)) {
      return absl::InternalError(absl::StrCat("the camera of the view '", view.name, "' gave ",
                                              image.pixels.size(), " bytes, which is no image"));
    }
    const cv::Mat pixels(image.height, image.width, colour ? CV_8UC3 : CV_8UC1,
                         image.pixels.data());
    set.images.push_back(pixels.clone());
    set.captured = std::min(set.captured, image.captured);
  }
  RETURN_IF_ERROR(CheckLife(set));
  return set;
}

absl::Status CellCameras::CheckLife(const ImageSet& set) {
  const ImageSet before = std::exchange(last_, set);
  for (size_t v = 0; v < before.images.size(); ++v) {
    const std::string& name = views_[v].name;
    if (!noisy_views_.contains(name) || !SameImage(before.images[v], set.images[v])) continue;
    repeated_ = before.captured;
    return absl::UnavailableError(absl::StrCat(
        "the camera of the view '", name, "' is frozen: it repeats an image byte for byte; ",
        "restart the camera; if its source has no noise (a recording, a simulator, strong "
        "compression), state 'noise: none' at its view in the cell file"));
  }
  return absl::OkStatus();
}

}  // namespace silhouette
