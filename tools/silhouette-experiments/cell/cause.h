// SPDX-License-Identifier: Apache-2.0
// Why a policy called a configuration free where robot and obstacle touch: from the truth about the
// places of contact and from what the images have there.
//
// A place of contact convicts a configuration by itself if a view shows an obstacle there and, for
// calibrated presets, no view shows background there (Table 3); without a calibration as many views
// must show an obstacle as the policy asks for. Where the robot itself is on the line of sight, in
// front or behind, no camera that tells only what differs from the empty cell could see an
// obstacle. So a missing configuration is *hidden* if no place of contact would convict it even in
// perfect images - in all views, or in more than the policy allows for; else something went wrong
// at the place that would.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "server/collision/policy.h"

namespace silhouette::cell_experiment {

enum class Cause : uint8_t {
  kHidden = 0,  // by the robot in all views: no camera could see it
  kOccluded,    // by the robot in some views, more than the policy allows for
  kContrast,    // differencing: it looks like the empty cell
  kRim,         // discretisation: a mask pixel that the robot covers in part
  kRobotCell,   // discretisation: the robot stands between grid points, its image is a union
  kShadow,      // differencing: the robot's image has its shadow
  kRobotImage,  // the robot image of the test configuration lacks the place
  kTestCell,    // discretisation: the images of the grid cell's corners lack the place
  kSize,        // sound presets: what is there is smaller than the least obstacle
  kUnexplained,
};
inline constexpr size_t kCauses = 10;

// "hidden", "contrast", ...
std::string NameOf(Cause cause);

// What one view has of one place of contact.
struct PlaceInView {
  // Whether the robot, as it stood in the scene, is on the line of sight, before or behind.
  bool robot_in_line = false;
  // The pixel of the place in the obstacle image, ...
  enum Plane : uint8_t { kBackground, kObstacle, kUnknown, kError } plane = kBackground;
  // ... and whether the test robot image has it.
  bool in_test_image = false;
  // Where the robot is not in line but its image covers the pixel: why.
  Cause cover = Cause::kRim;
};

// Per view.
using Place = std::vector<PlaceInView>;

struct CauseFound {
  Cause cause = Cause::kUnexplained;
  size_t place = 0;  // the place that the cause speaks of
  size_t view = 0;   // the view with the fault; kHidden, kOccluded, kSize, kUnexplained: 0
};

// `places`: at least one, all of as many views. `on_grid`: where the test configuration is.
CauseFound FindCause(std::span<const Place> places, const Policy& policy, bool on_grid);

}  // namespace silhouette::cell_experiment
