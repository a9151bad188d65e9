// SPDX-License-Identifier: Apache-2.0
// What long work in the cell tells, and asks, while it goes on.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

namespace silhouette {

// What to do when the cell is no longer as it was.
enum class AfterAlarm {
  kEnd,         // the session; it can be gone on with
  kCheckAgain,  // somebody has mended it
  kGoOn,        // what is captured stays suspect
};

struct CaptureObserver {
  // Configurations, or sets of reference images, that are done with.
  std::function<void(uint64_t done)> progress = [](uint64_t) {};
  // Something worth a line happened.
  std::function<void(const std::string& line)> say = [](const std::string&) {};
  // Something worth a line in the log, and no more.
  std::function<void(const std::string& line)> note = [](const std::string&) {};
  // Asked when the sentinels no longer match, and why; the robot stands still meanwhile.
  std::function<AfterAlarm(const std::string& why)> alarm = [](const std::string&) {
    return AfterAlarm::kEnd;
  };
  // Asked when a lost robot can be reached again: whether it may move. The
  // operator must make sure that nobody is in the cell.
  std::function<bool()> robot_may_move = [] { return false; };
  // Asked before each move of the robot and each set, and while a lost device is waited for.
  std::function<bool()> stop_requested = [] { return false; };
};

}  // namespace silhouette
