// SPDX-License-Identifier: Apache-2.0
// How the server takes images itself.
#pragma once

#include <string>

#include "absl/time/time.h"

namespace silhouette {

// When a camera is taken for frozen (proof_of_life.h).
struct LifeSettings {
  // Least noise from one image to the next, as a share of the reference's (standard deviations).
  // Live cameras have about 1, also if lights flickered or drifted while the reference was made;
  // still images that are encoded again, or whose noise is filtered away, less than 0.1.
  double least_noise = 0.15;
  // Least number of pixels that change where the robot moved to, or where it was, as a share of
  // those where it moved to. It covers them all, and looks different from the cell on most; a still
  // image changes on none.
  double least_change = 0.1;
};

struct LiveSettings {
  // The variant that shows the robot when the server starts; empty: it has to be sent,
  // where the database has several.
  std::string variant = "";
  // Least time from one set of images to the next.
  absl::Duration interval = absl::Milliseconds(20);
  // How often the robot is asked for its joints.
  absl::Duration joints_interval = absl::Milliseconds(5);
  // Longest time between the images and a joint sample, before and after.
  absl::Duration joints_gap = absl::Milliseconds(100);
  // The most that a joint may move around the images: radians, metres.
  double max_joint_movement = 0.01;
  // Evidence at the robot's rim has to last (SceneMask::strong_before) only if a view's image
  // before is no further back: in two mask pixels of 3 cm a finger at 1.2 m/s comes as far.
  absl::Duration evidence_gap = absl::Milliseconds(50);
  // How long after an error a device is asked again: doubled from the first to the longest.
  absl::Duration first_retry = absl::Milliseconds(50);
  absl::Duration longest_retry = absl::Seconds(2);
  // The robot is closed and opened again if it gave only errors for so long; the cameras, if none
  // of them gave an image that can be used.
  absl::Duration reopen_after = absl::Seconds(5);
  // How often the log reports the state of acquisition.
  absl::Duration report_interval = absl::Minutes(1);
  // Images that are differenced at once.
  int threads = 2;
  LifeSettings life = {};
};

}  // namespace silhouette
