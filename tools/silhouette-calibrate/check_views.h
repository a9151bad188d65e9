// What `silhouette-calibrate check` asks of every view.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/files/calibration_check_file.h"
#include "calib/fundamental/tag_drift.h"
#include "db/mask/configuration_grid.h"
#include "server/scene/scene_settings.h"
#include "tools/silhouette-calibrate/check_now.h"

namespace silhouette {

struct CheckRequest {
  std::string database;
  std::string corners;    // of now; empty: not by tags
  std::string reference;  // corners of then; empty: as the database has them
  std::string images;     // folder with VIEW.png; empty: not by silhouettes
  std::optional<ConfigurationNumber> number;
  std::string cell;  // cell.yaml, whose segmentation makes the masks
  // Instead of files of now, what the cell's cameras see: tags of `boards`, and with `number` the
  // silhouettes.
  bool live = false;
  std::vector<std::string> boards;
  int sets = LiveLook{}.sets;
  // Mask pixels: what the server's margin leaves for moves, if the calibration itself errs by no
  // more than 0.05. Cameras that all moved by m need a margin of m.
  double limit = CalibrationSettings{}.margin - 0.05;
};

struct Checked {
  CalibrationCheck check;
  std::vector<ViewDrift> drifts;  // per view
  std::vector<ViewSizes> sizes;
};

// A view that is checked in both ways is told by the one that says it moved more; one that could
// not be checked in a way that was asked for is not checked, unless the other way says that it
// moved by more than the limit. The errors tell what is missing.
absl::StatusOr<Checked> CheckViews(const CheckRequest& request);

}  // namespace silhouette
