// SPDX-License-Identifier: Apache-2.0
// Whether a view of a scene is as the reference and the robot images say: light, structure, place
// of the camera, amount of foreground, the robot.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "capture/segmentation/image_condition.h"
#include "db/mask/mask.h"
#include "server/scene/robot_in_scene.h"
#include "server/scene/scene.h"
#include "server/scene/scene_settings.h"

namespace silhouette {

// What is known of one view of a scene. Pointers: null where it is not known.
struct ViewToCheck {
  std::string name;
  const ImageCondition* condition = nullptr;  // of its camera image
  const Mask* foreground = nullptr;           // not of a sensor that separates the robot by itself
  const RobotCover* robot = nullptr;
  const Mask* base = nullptr;     // pixels that the robot covers wherever it stands
  const Mask* ignored = nullptr;  // pixels that prove nothing
};

// What is wrong with the views of a scene: each a defect with which no verdict is free. `names`: of
// all views of the cell, for ImageCondition::other. Views that can tell where the robot is have a
// foreground, and pixels where it may be. Of several the one that misses most of it does not count:
// what is as bright as the floor hides it in one.
std::vector<SceneDefect> CheckViews(std::span<const ViewToCheck> views,
                                    std::span<const std::string> names,
                                    const ViewCheckSettings& settings);

}  // namespace silhouette
