// SPDX-License-Identifier: Apache-2.0
// A missing configuration as a picture: what every view had of it, and why it was called free.
#pragma once

#include "common/picture/picture.h"
#include "tools/silhouette-experiments/cell/study.h"

namespace silhouette::cell_experiment {

// One column per view: the camera image, the scene image and the obstacle image, each with the
// outline of the test robot image and a ring around the place of contact.
Picture Draw(const TrialSetting& setting, const ViewedScene& viewed,
             const ExplainedConfiguration& missing);

// Per view what the robot covers; above, where the obstacles are that nobody sees; below, where the
// sound presets say that an obstacle may be. The database can serve them.
Picture DrawPossible(const TrialSetting& setting, const ViewedScene& viewed);

}  // namespace silhouette::cell_experiment
