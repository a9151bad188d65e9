// SPDX-License-Identifier: Apache-2.0
// What `check` asks of every view.
#pragma once

#include <map>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/files/calibration_check_file.h"
#include "calib/fundamental/tag_drift.h"
#include "db/mask/configuration_grid.h"
#include "server/scene/scene_settings.h"
#include "silhouette/storage/v1/storage.pb.h"
#include "tools/cell/cell.h"

namespace silhouette {

struct CheckRequest {
  std::string database;
  std::string corners;    // current; empty: tags are not checked
  std::string reference;  // corners at calibration; empty: those in the database
  std::string images;     // folder with VIEW.png; empty: silhouettes are not checked
  std::optional<ConfigurationNumber> number;
  std::string cell;  // cell.yaml, whose segmentation makes the masks
  // Instead of files, images from the cell's cameras: tags of `boards`, and with `number` the
  // silhouettes.
  bool live = false;
  std::vector<std::string> boards;
  int sets = 5;  // of live images, in which tags are looked for
  // Mask pixels: what the server's margin leaves for moves, if the calibration itself errs by no
  // more than 0.05. Cameras that all moved by m need a margin of m.
  double limit = CalibrationSettings{}.margin - 0.05;
};

struct Checked {
  CalibrationCheck check;
  std::vector<ViewDrift> drifts;  // per view
  std::vector<ViewSizes> sizes;
};

// If both checks ran for a view, the result is the larger motion. If one requested check could not
// run, the view is not checked, unless the other one found a motion beyond the limit. Errors name
// what is missing.
absl::StatusOr<Checked> CheckViews(const CheckRequest& request);

}  // namespace silhouette
