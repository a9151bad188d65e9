// SPDX-License-Identifier: Apache-2.0
// How a capture went.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "db/mask/mask.h"

namespace silhouette {

// The robot images of one view.
struct ViewQuality {
  std::string name;
  uint64_t images = 0;
  uint64_t empty = 0;            // the robot is not to be seen
  uint64_t touching_border = 0;  // it may not be whole in the image
  uint64_t area = 0;             // pixels of the robot, all images together

  void Add(const Mask& mask);
  // Pixels per image; 0 without images.
  double mean_area() const;
};

struct CaptureReport {
  // Not OK: what ended the session early. A stop that was asked for is none.
  absl::Status status;
  bool stopped = false;

  uint64_t planned = 0;   // to be captured
  uint64_t captured = 0;  // of these: durably stored
  uint64_t excluded = 0;  // in forbidden regions, durably stored as such in this session
  uint64_t kept = 0;      // records that stayed as they were
  // Configurations that the robot did not reach, or from which no good measurement came.
  uint64_t failed = 0;
  // Configurations to which there is no way around the forbidden regions.
  uint64_t unreachable = 0;

  // What no longer matched when the sentinels were visited last, or that none could be visited;
  // empty: all matched.
  std::string alarm;
  bool none_visited = false;  // the latter
  uint64_t sentinel_checks = 0;
  // The sentinels that were to be captured again are not yet what the database compares with.
  bool new_sentinels_left = false;
  // Robot images in the database that were captured while the cell may have been changed, or that
  // a session that captured everything again did not come to.
  uint64_t suspect = 0;
  // How long lost devices were waited for, and how often.
  uint64_t losses = 0;
  absl::Duration waited;

  std::vector<ViewQuality> views;
  // Largest deviation of a joint at a configuration that was captured: radians, metres.
  double max_deviation = 0;
  absl::Duration duration;

  bool complete() const { return status.ok() && alarm.empty() && captured == planned; }
};

}  // namespace silhouette
