// What the cameras see of a hidden ball, and what the sound test makes of it.
#pragma once

#include "common/picture/picture.h"
#include "tools/silhouette-experiments/hidden/study.h"

namespace silhouette::hidden_experiment {

// Per view: what the robot covers; above, where the ball is that nobody sees; below, where an
// obstacle may be.
Picture PictureOf(const HiddenCell& cell, const HiddenBall& ball, const Served& served);

}  // namespace silhouette::hidden_experiment
