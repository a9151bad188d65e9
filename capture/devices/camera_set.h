// SPDX-License-Identifier: Apache-2.0
// CameraSet: the cameras of a cell, whatever they are, triggered together.
#pragma once

#include <cstdint>
#include <future>
#include <memory>
#include <string>
#include <vector>

#include "capture/devices/devices.h"

namespace silhouette {

// What became of the images of a view since the start.
struct ViewCounts {
  uint64_t taken = 0;
  uint64_t lost = 0;        // did not come in time, or the camera was not there
  uint64_t incomplete = 0;  // came with parts missing
};

class CameraSet : public CameraRig {
 public:
  // `views` in the order that Grab() is to return them; each is one of exactly one source's. Throws
  // std::invalid_argument if it is not.
  CameraSet(std::vector<std::string> views, std::vector<std::unique_ptr<CameraSource>> sources);
  ~CameraSet() override;

  const std::vector<std::string>& views() const override { return views_; }

  // Reaches devices that were lost, then triggers all sources, one right after the other, then
  // waits for all. The set is complete or an error that names the view: DeadlineExceeded or
  // Unavailable if asking again may help. No image of a set that failed is ever part of a later
  // one.
  absl::StatusOr<std::vector<CameraImage>> Grab() override;

  // The same, with the images that came and, for every other view, why its own did not. Devices
  // that were lost are waited for only if no other is there.
  std::vector<absl::StatusOr<CameraImage>> GrabEach() override;

  // In the order of views().
  const std::vector<ViewCounts>& counts() const { return counts_; }

 private:
  // What is known of a source that was lost.
  struct Reaching {
    std::future<absl::Status> opened;  // Open(), under way: nothing else of the source is called
    absl::Status why;                  // the error of the last one; OK: none has ended yet
  };

  // GrabEach(); `complete`: lost devices are waited for in any case.
  std::vector<absl::StatusOr<CameraImage>> Take(bool complete);

  // By source, whether it is there. Opens those that are not, at the same time.
  std::vector<absl::Status> ReachAll(bool complete);

  // By source, whether it was triggered: all that are there, one right after the other. After the
  // first that fails the rest at the same time.
  std::vector<absl::Status> TriggerAll(bool complete);

  // The error to report for the image of a view of this source, which it counts.
  absl::Status Failed(size_t source, size_t view, const absl::Status& status);

  const std::vector<std::string> views_;
  std::vector<std::unique_ptr<CameraSource>> sources_;
  std::vector<Reaching> reaching_;           // by source
  std::vector<std::vector<size_t>> places_;  // by source: where its images go
  std::vector<ViewCounts> counts_;
};

// The time between the oldest and the newest of the images; 0 if there is none.
absl::Duration SkewOf(const std::vector<CameraImage>& images);

}  // namespace silhouette
