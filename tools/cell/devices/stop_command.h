// SPDX-License-Identifier: Apache-2.0
// How a robot is stopped when its program is ended at once.
#pragma once

#include <functional>
#include <iostream>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "capture/devices/devices.h"

namespace silhouette {

// For HaltOnSignals: stops the robot, which must outlive it, and then says so.
inline std::function<void()> StopCommandTo(Robot& robot) {
  return [&robot] {
    absl::Status stopped = robot.Stop();
    if (!absl::IsUnavailable(stopped) && !absl::IsDeadlineExceeded(stopped)) {
      // A move that was just being sent may have come after that.
      absl::SleepFor(absl::Milliseconds(50));
      stopped = robot.Stop();
    }
    std::cerr << (stopped.ok()
                      ? "\nthe robot received a stop command"
                      : absl::StrCat("\nthe stop command to the robot failed: ", stopped.message()))
              << std::endl;
  };
}

}  // namespace silhouette
