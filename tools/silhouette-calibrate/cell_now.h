// SPDX-License-Identifier: Apache-2.0
// What `check` is asked, and what the cell shows now, from files or from the cameras.
#pragma once

#include <opencv2/core/mat.hpp>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "calib/boards/sighting_file.h"
#include "calib/files/calibration_check_file.h"
#include "db/mask/configuration_grid.h"
#include "silhouette/storage/v1/storage.pb.h"
#include "tools/cell/cell.h"
#include "tools/silhouette-calibrate/calibration_output.h"

namespace silhouette {

// What the user asks `check`.
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
  int sets = 5;               // of live images, in which tags are looked for
  double limit = kMostMoved;  // mask pixels
};

// What the cell shows now.
struct CellNow {
  std::optional<std::vector<TagSighting>> tags;  // nothing: they were not asked for
  std::set<std::string> without_noise;           // views whose images may repeat
  std::vector<cv::Mat> images;                   // by view; empty: as before
  absl::Time written = absl::InfiniteFuture();   // the oldest of the files that it is read from
};

// A sighting file of images of the cell's sizes. InvalidArgument, naming the file.
absl::StatusOr<std::vector<TagSighting>> ReadSightingsOf(const storage::v1::CellDescription& cell,
                                                         const std::string& file);

// The cell file, if it is of the database.
absl::StatusOr<Cell> CellFor(const CheckRequest& request, const storage::v1::CellDescription& cell);

// `looked` is set once cameras are opened. Cancelled if a stop was asked for; else the errors of
// files and cameras.
absl::StatusOr<CellNow> NowOf(const CheckRequest& request,
                              const storage::v1::CellDescription& description, bool& looked);

}  // namespace silhouette
