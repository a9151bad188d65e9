// SPDX-License-Identifier: Apache-2.0
// When a scene is good enough to rest a verdict on.
#pragma once

#include <cstdint>

#include "absl/time/time.h"

namespace silhouette {

// What faint obstacle components are that lie alone at the rim of the robot's image
// (ObstacleImage::WithoutWeakRim).
enum class WeakRim { kUnknown, kObstacle };

struct SceneSettings {
  // Oldest image that a verdict may rest on.
  absl::Duration max_age = absl::Seconds(1);
  // Whether a published image without a capture time counts as taken at its arrival. Dangerous: an
  // image that was held up on its way is then older than it seems, by any time.
  bool accept_arrival_times = false;
  // Largest time between the images of one scene.
  absl::Duration max_skew = absl::Milliseconds(50);
  // More core error pixels than this in any view, as a share of the view's pixels, and the scene is
  // not trusted.
  double max_core_error = 0.005;
  // Largest deviation of a joint outside the grid from where it stood at capture: radians, metres.
  double fixed_joint_tolerance = 0.005;
  // Noise at the rim of the robot and its shadow, unless there is a reason to block for it.
  WeakRim weak_rim = WeakRim::kUnknown;
};

// How the collision index is checked while it is served. It lies in the database's file, which
// other programs and a failing disk can change after it was loaded.
struct IndexCheckSettings {
  // Bytes of the index that are read again, and verified, each second: a pass of 30 MB takes half a
  // second then, one of 0.4 GB seven seconds; it costs about a hundredth of a core.
  uint64_t rate = 64'000'000;
  // Random configurations per scene whose verdict in the map must be that of their robot images.
  // They cost less than a map, and find what no checksum covers.
  int samples = 16;
};

// How far a calibration is trusted.
struct CalibrationSettings {
  // Pixels of the masks by which every pixel's square is widened on all sides before epipolar lines
  // are drawn through it: for the error of the calibration.
  double margin = 0.25;
};

}  // namespace silhouette
