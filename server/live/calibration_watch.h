// SPDX-License-Identifier: Apache-2.0
// Follows the file of the newest check of the calibration (silhouette-calibrate check --out).
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <thread>

#include "server/scene/clock.h"
#include "server/scene/scene_store.h"

namespace silhouette {

struct CalibrationWatchSettings {
  std::string file;
  // A check that is older is none.
  absl::Duration max_age = absl::InfiniteDuration();
};

// What the file says at the moment `now`. One that cannot be read, is none, is from the future, or
// in which a view moved or was not checked: does not hold, and why. Whether it has become too old
// and is of the database that is served is another question (CalibrationDoubt in checker.h).
CalibrationTrust ReadTrust(const CalibrationWatchSettings& settings, const Moment& now);

// Reads the file every half second, and reports its content: at once, in the constructor, and
// whenever its content or what follows from it has changed, also if a corrected clock makes a check
// end earlier. A check that becomes too old is not reported (CalibrationTrust::until has its end).
// The calls come from the constructor and a thread of its own.
class CalibrationWatch {
 public:
  using Tell = std::function<void(std::shared_ptr<const CalibrationTrust>)>;

  CalibrationWatch(CalibrationWatchSettings settings, Clock clock, Tell tell);

 private:
  void Look();

  const CalibrationWatchSettings settings_;
  const Clock clock_;
  const Tell tell_;
  std::string told_;  // in words, and the file's content
  absl::Duration told_until_ = absl::InfiniteDuration();
  std::jthread thread_;  // last: it uses the others
};

}  // namespace silhouette
