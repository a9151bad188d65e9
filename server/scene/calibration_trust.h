// Whether the calibration still holds, by the newest check of the cell (silhouette-calibrate
// check).
#pragma once

#include <string>

#include "absl/time/time.h"

namespace silhouette {

struct CalibrationTrust {
  bool holds = false;
  // The calibration that was checked (FingerprintOf in calib/files/calibration_message.h). It tells
  // nothing of another.
  std::string fingerprint;
  // The moment of the running clock (clock.h) from which on the check is too old.
  absl::Duration until = absl::InfiniteDuration();
  // What was found, or why it is not known.
  std::string message;
};

}  // namespace silhouette
