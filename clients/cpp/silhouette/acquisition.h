// SPDX-License-Identifier: Apache-2.0 State of a server's own acquisition (silhouette-server
// --live).
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/time/time.h"

namespace silhouette::client {

// A camera, or the robot.
struct AcquiredDevice {
  // The view; empty: the robot.
  std::string view;
  // The newest image, or joint values, is not older than max_age.
  bool serving = false;
  // Usable images, or joint values, and failures.
  uint64_t good = 0;
  uint64_t errors = 0;
  // Age of the newest one; nothing: there is none yet.
  std::optional<absl::Duration> age;
  // Why the last request failed; empty if it did not.
  std::string fault;
  // The newest error, even if it is over; empty: no error yet.
  std::string last_error;
  absl::Time last_error_time;
};

// Of the newest few thousand; `count` counts all.
struct AcquisitionLatency {
  uint64_t count = 0;
  absl::Duration median;
  absl::Duration p99;
  absl::Duration longest;
};

// The robot's variant in images from now on.
struct RobotVariant {
  // Empty: unknown, and nothing is free.
  std::string variant;
  // The variant is changing.
  bool changing = false;
  // Why the variant is unknown, and the mend; empty if it is known.
  std::string unknown;
};

struct VariantChange {
  RobotVariant robot_variant;
  // The newest scene at the change. The variant does not hold for it or for older scenes; 0: there
  // was no scene.
  uint64_t last_scene_before = 0;
};

struct Acquisition {
  // All cameras and the robot are serving.
  bool serving = false;
  absl::Time started;
  uint64_t scenes = 0;
  // Sets of images that did not become a scene.
  uint64_t lost_sets = 0;
  // Why the newest set did not become a scene; empty if it did.
  std::string fault;
  std::vector<AcquiredDevice> cameras;
  AcquiredDevice robot;
  // From the last pixel of a set of images to its scene, and to the map of all configurations.
  AcquisitionLatency to_scene;
  AcquisitionLatency to_map;
  RobotVariant robot_variant;
};

}  // namespace silhouette::client
