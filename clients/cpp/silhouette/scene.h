// SPDX-License-Identifier: Apache-2.0 Scenes, as published and as the server stores them.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "absl/time/time.h"
#include "silhouette/mask.h"
#include "silhouette/verdict.h"

namespace silhouette::client {

// A joint of the robot, by name: radians, for prismatic joints metres.
struct JointPosition {
  std::string name;
  double position = 0;
};

// The foreground pixels: where the image differs from the reference.
struct SceneMask {
  Mask mask;
};
// The bytes of an image file (PNG, JPEG, ...). The server subtracts the background.
struct CameraImage {
  std::string bytes;
};
// From a sensor that distinguishes obstacles from the robot: the obstacle pixels.
struct ObstacleMask {
  Mask mask;
};

// What one view saw.
struct ViewImage {
  std::string view;
  // Nothing: the time of arrival at the server.
  std::optional<absl::Time> capture_time;
  std::variant<SceneMask, CameraImage, ObstacleMask> image;
};

// The obstacle image of a view, as planes that partition it together with the background.
struct ScenePlanes {
  Mask scene;
  Mask obstacle;
  Mask unknown;
  Mask error;
  Mask ignored = Mask();  // pixels that prove nothing; empty: the view has none
};

struct SceneView {
  std::string view;
  absl::Time capture_time;
  uint32_t foreground_pixels = 0;
  uint32_t obstacle_pixels = 0;
  uint32_t unknown_pixels = 0;
  uint32_t error_pixels = 0;
  // Error pixels whose neighbours are all error pixels. Many mean: the robot is not where it
  // reports, a camera moved, or the light changed.
  uint32_t core_error_pixels = 0;
  double margin = 0;  // safety margin that the pixels were given, in pixels
  uint32_t ignored_pixels = 0;
  // Only if requested.
  std::optional<ScenePlanes> planes;
};

// Why verdicts from a scene are not free.
struct SceneDefect {
  Reason reason = Reason::kUnspecified;
  std::string message;  // one sentence that names the thing and the mend
};

struct Scene {
  uint64_t id = 0;
  uint64_t database_generation = 0;
  absl::Time time;      // of the oldest image
  absl::Duration skew;  // between the oldest and the newest
  std::vector<JointPosition> joints;
  // The robot's variant in these images; empty: the server knows no variants.
  std::string variant = "";
  // In the order of the database's views, without those that are missing.
  std::vector<SceneView> views;
  // Empty in a good scene.
  std::vector<SceneDefect> defects;
};

}  // namespace silhouette::client
