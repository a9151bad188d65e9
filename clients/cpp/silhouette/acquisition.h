// SPDX-License-Identifier: Apache-2.0
// How the acquisition of a server that takes images itself goes (silhouette-server --live).
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
  // Whether what it gave last is no older than a scene may be.
  bool serving = false;
  // How often it gave an image, or its joints, that could be used, and how often not.
  uint64_t good = 0;
  uint64_t errors = 0;
  // How old what it gave last is; nothing: it gave nothing yet.
  std::optional<absl::Duration> age;
  // Why it gave nothing that could be used when it was asked last; empty if it did.
  std::string fault;
  // Of its newest error, gone or not; empty: there was none.
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

// Which variant shows the robot, in images that are taken from now on.
struct RobotVariant {
  // Empty: it is not known, and nothing is free.
  std::string variant;
  // It is being changed.
  bool changing = false;
  // Why it is not known, and the mend; empty if it is.
  std::string unknown;
};

struct VariantChange {
  RobotVariant robot_variant;
  // What is known now holds for none of the scenes up to this one; 0: there was none.
  uint64_t last_scene_before = 0;
};

struct Acquisition {
  // Whether all cameras and the robot are.
  bool serving = false;
  absl::Time started;
  uint64_t scenes = 0;
  // Sets of images of which no scene was made.
  uint64_t lost_sets = 0;
  // Why the newest set is no scene; empty if it is.
  std::string fault;
  std::vector<AcquiredDevice> cameras;
  AcquiredDevice robot;
  // From the last pixel of a set of images to its scene, and to the map of all configurations.
  AcquisitionLatency to_scene;
  AcquisitionLatency to_map;
  RobotVariant robot_variant;
};

}  // namespace silhouette::client
