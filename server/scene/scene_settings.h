// SPDX-License-Identifier: Apache-2.0
// When a scene is good enough to rest a verdict on.
#pragma once

#include <cstdint>

#include "absl/time/time.h"

namespace silhouette {

// What small obstacle components are that lie alone at the rim of the robot's image and are faint,
// or were not there in the image before (ObstacleImage::WithoutWeakRim, SceneMask::strong_before).
enum class WeakRim { kUnknown, kObstacle };
// When a view is not as its reference and the robot images say (view_check.h). The figures are
// those of the demo's cell while people walk about (docs/live.md).
struct ViewCheckSettings {
  // Brightness of a view, as a multiple of its reference's. Within these bounds the segmentation
  // follows; light that is switched off, halved or doubled is outside.
  double least_gain = 0.6;
  double greatest_gain = 1.7;
  // Largest share of saturated pixels: they show no obstacle.
  double most_saturated = 0.5;
  // Least share of the cell's structure where nothing is foreground. People who walk about leave
  // 0.77 and more; another view or a cover less than 0.08.
  double least_structure = 0.4;
  // How far the cell may have moved in a view, in camera pixels. People and noise move it by less
  // than 0.5; a camera that turns by 1 degree, by 4 and more.
  double most_shift = 1.5;
  // Largest share of a view's mask that is foreground beside the robot. People fill more only where
  // they stand close before a camera.
  double most_foreground = 0.75;
  // Largest share of the pixels which the robot certainly covers, its base apart, that show
  // background: the sum over all views but the worst; 1.7 times that with three views and more.
  // Someone as bright as the floor hides up to 0.4 of them in one view, and 0.07 in the others.
  // With an arm that is 8 degrees away they miss 0.1 and more together, if it is not folded.
  double most_robot_missing = 0.05;
};

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
  ViewCheckSettings view_check = {};
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
  // are drawn through it, and the outlines of drawn robots: for the error of the calibration.
  double margin = 0.25;
};

}  // namespace silhouette
