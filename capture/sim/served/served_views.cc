// SPDX-License-Identifier: Apache-2.0
#include "capture/sim/served/served_views.h"

#include <utility>

#include "absl/time/clock.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

// How far apart in time those ask who trigger their cameras together.
constexpr absl::Duration kTogether = absl::Milliseconds(50);

}  // namespace

absl::StatusOr<std::unique_ptr<ServedViews>> ServedViews::Create(
    std::shared_ptr<SimulatedCell> cell, const std::vector<SimulatedView>& views) {
  ASSIGN_OR_RETURN(auto cameras, CamerasOf(cell->settings(), views));
  return std::unique_ptr<ServedViews>(new ServedViews(std::move(cell), views, std::move(cameras)));
}

ServedViews::ServedViews(std::shared_ptr<SimulatedCell> cell, std::vector<SimulatedView> views,
                         std::vector<size_t> cameras)
    : cell_(std::move(cell)),
      views_(std::move(views)),
      cameras_(std::move(cameras)),
      taken_(views_.size()) {}

CameraImage ServedViews::Take(size_t view) {
  const std::lock_guard lock(mutex_);
  const bool together = !set_.empty() && !taken_[view] && absl::Now() - made_ < kTogether &&
                        cell_->positions() == positions_;
  if (!together) TakeSet();
  taken_[view] = true;
  return set_[view];
}

void ServedViews::TakeSet() {
  taken_.assign(views_.size(), false);
  if (frozen_ && !set_.empty()) return;
  positions_ = cell_->positions();
  set_ = cell_->TakeImages(cameras_);
  made_ = absl::Now();
  ++sets_;
}

std::vector<CameraImage> ServedViews::TakeAll() {
  const std::lock_guard lock(mutex_);
  TakeSet();
  taken_.assign(views_.size(), true);
  std::vector<CameraImage> images = set_;
  if (frozen_) {
    for (CameraImage& image : images) image.captured = absl::Now();
  }
  return images;
}

void ServedViews::Freeze(bool frozen) {
  const std::lock_guard lock(mutex_);
  frozen_ = frozen;
}

uint64_t ServedViews::sets() const {
  const std::lock_guard lock(mutex_);
  return sets_;
}

std::vector<uint8_t> GreyPixels(CameraImage image) {
  if (image.channels == 1) return std::move(image.pixels);
  std::vector<uint8_t> grey;
  grey.reserve(image.pixels.size() / 3);
  for (size_t i = 0; i + 2 < image.pixels.size(); i += 3) {  // the weights of ITU-R BT.601
    grey.push_back(static_cast<uint8_t>(
        (114 * image.pixels[i] + 587 * image.pixels[i + 1] + 299 * image.pixels[i + 2]) / 1000));
  }
  return grey;
}

}  // namespace silhouette
