// SPDX-License-Identifier: Apache-2.0
// ServedViews: the images of a simulated cell for servers of which each asks for one view at a
// time.
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "capture/devices/devices.h"
#include "capture/sim/simulated_cell.h"

namespace silhouette {

// Thread-safe.
class ServedViews {
 public:
  // A view for each of `views`. Errors: CameraOf()'s.
  static absl::StatusOr<std::unique_ptr<ServedViews>> Create(
      std::shared_ptr<SimulatedCell> cell, const std::vector<SimulatedView>& views);

  const std::vector<SimulatedView>& views() const { return views_; }

  // The image of a view, 1 channel or 3, as the cell is now. Those who ask for different views at
  // about the same time get images of one set.
  CameraImage Take(size_t view);

  // One image of each.
  std::vector<CameraImage> TakeAll();

  // While it is frozen, the images are those of the last set, again and again.
  void Freeze(bool frozen);

  // How many sets of images were taken.
  uint64_t sets() const;

 private:
  ServedViews(std::shared_ptr<SimulatedCell> cell, std::vector<SimulatedView> views,
              std::vector<size_t> cameras);

  const std::shared_ptr<SimulatedCell> cell_;
  const std::vector<SimulatedView> views_;
  const std::vector<size_t> cameras_;  // by view

  // With mutex_ held: takes a set of images, unless it is frozen.
  void TakeSet();

  mutable std::mutex mutex_;  // guards all below
  std::vector<CameraImage> set_;
  std::vector<bool> taken_;        // by view: whether its image of the set was given out
  std::vector<double> positions_;  // of the robot in the set
  absl::Time made_ = absl::InfinitePast();
  bool frozen_ = false;
  uint64_t sets_ = 0;
};

// A byte per pixel, of a grey or coloured image.
std::vector<uint8_t> GreyPixels(CameraImage image);

}  // namespace silhouette
