// SPDX-License-Identifier: Apache-2.0
// Where a robot is after something happened, such as after its images were taken.
#pragma once

#include "absl/status/statusor.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "capture/devices/devices.h"

namespace silhouette {

// Asks until the positions were measured at `since` (running clock) or later. Errors are those of
// Robot::State(), which fails once a robot reports nothing new.
inline absl::StatusOr<RobotState> StateSince(Robot& robot, absl::Duration since) {
  constexpr absl::Duration kPause = absl::Milliseconds(2);
  for (;;) {
    absl::StatusOr<RobotState> state = robot.State();
    if (!state.ok() || state->not_before.value_or(since) >= since) return state;
    absl::SleepFor(kPause);
  }
}

}  // namespace silhouette
