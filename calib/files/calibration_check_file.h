// SPDX-License-Identifier: Apache-2.0
// What `silhouette-calibrate check` found, as a JSON file that a server is given:
//
//   {"check": 1, "time": "2026-11-21T21:00:00Z", "calibration": "0123456789abcdef",
//    "limit_mask_px": 0.25, "holds": false,
//    "views": [{"name": "top", "method": "tags", "checked": true, "moved_px": 0.1,
//               "moved_mask_px": 0.01, "holds": true, "message": "..."}, ...]}
//
// Programs may write further keys; they are skipped.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"

namespace silhouette {

struct CheckedView {
  std::string name;
  std::string method;    // "tags" or "silhouettes"; empty: none ended
  bool checked = false;  // else `message` says why not
  double moved_px = 0;   // by how many pixels of the camera image it moved
  double moved_mask_px = 0;
  bool holds = false;  // checked, and moved by no more than the limit
  std::string message;
};

struct CalibrationCheck {
  absl::Time time;
  std::string calibration;  // its fingerprint (calibration_message.h)
  double limit_mask_px = 0;
  std::vector<CheckedView> views;

  // Every view was checked and holds; there is at least one.
  bool Holds() const;
  // "view 'top' moved by 3.1 px (0.31 mask px)", or that none moved.
  std::string Summary() const;
};

std::string CheckFileText(const CalibrationCheck& check);

// InvalidArgument: not such a file, another version, a value that is missing, a motion or a limit
// that is negative or no number, or "holds": false though every view does.
absl::StatusOr<CalibrationCheck> CheckFromText(const std::string& text, const std::string& file);

}  // namespace silhouette
