// SPDX-License-Identifier: Apache-2.0
// Pictures of missing configurations: what every view shows, and why they were reported free.
#pragma once

#include <vector>

#include "common/picture/picture.h"
#include "tools/silhouette-experiments/cell/explanation.h"

namespace silhouette::cell_experiment {

// A missing configuration of a record, by their indices.
struct Chosen {
  size_t record = 0;
  size_t missing = 0;
};

// At most `count` missing configurations for pictures: two of every cause, then from the scenes
// with the most of them in turn.
std::vector<Chosen> ChooseForPictures(const std::vector<SceneRecord>& records, size_t count);

// One column per view: the camera image, the scene image and the obstacle image, each with the
// outline of the test robot image and a ring around the place of contact.
Picture Draw(const TrialSetting& setting, const ViewedScene& viewed,
             const ExplainedConfiguration& missing);

// Per view what the robot covers; above, where the hidden obstacles are; below, where the sound
// presets report that an obstacle may be. The database must serve these presets.
Picture DrawPossible(const TrialSetting& setting, const ViewedScene& viewed);

}  // namespace silhouette::cell_experiment
