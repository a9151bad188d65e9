// SPDX-License-Identifier: Apache-2.0
// How the images of one view are treated beyond Table 1: a safety margin, and pixels that prove
// nothing.
#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "calib/camera/calibration.h"
#include "db/mask/mask.h"

namespace silhouette {

// A safety margin as people say it: in pixels of the masks, or in metres.
struct Margin {
  double pixels = 0;
  double metres = 0;  // turned into pixels by the calibration, worst case over the workspace
};

struct ViewTreatmentSettings {
  Margin margin;
  // Of the view's mask size: pixels, such as those of a pillar before the camera, that are unknown
  // in every scene; nothing: none.
  std::optional<Mask> ignored;
};

struct TreatmentSettings {
  // One per view of the database; empty: no view is treated.
  std::vector<ViewTreatmentSettings> views;
  // The box that the robot never leaves, in its base frame, metres: for margins in metres.
  std::optional<Eigen::AlignedBox3d> workspace;
};

// The same in pixels alone.
struct ViewTreatment {
  double margin = 0;
  std::optional<Mask> ignored;
};

struct ViewTreatments {
  std::vector<ViewTreatment> views;  // one per view
  // FailedPrecondition if a margin in metres cannot be turned into pixels: why not, and the mend.
  // No scene is good for a free verdict then.
  absl::Status margins_known;
};

// What the settings come to with a calibration; null: there is none. `names` and `sizes` are those
// of the views and their masks. Throws std::invalid_argument if the settings are not of these views
// or sizes, if a margin is negative or not finite, or if one in metres comes without workspace.
ViewTreatments TreatmentsOf(const TreatmentSettings& settings, const Calibration* calibration,
                            std::span<const std::string> names, std::span<const MaskSize> sizes);

}  // namespace silhouette
