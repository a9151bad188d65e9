// What the cameras of a cell see now, for `silhouette-calibrate check`.
#pragma once

#include <map>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/fundamental/tag_drift.h"
#include "db/mask/configuration_grid.h"
#include "silhouette/storage/v1/storage.pb.h"
#include "tools/cell/cell.h"

namespace silhouette {

struct CellNow {
  std::optional<std::map<SeenTag, TagSighting>> tags;  // nothing: they were not asked for
  std::vector<cv::Mat> images;                         // by view; empty: as before
};

// A sighting file's tags, each the mean of all frames. InvalidArgument, naming the file.
absl::StatusOr<std::map<SeenTag, TagSighting>> ReadMeanSightings(const std::string& file);

// Of files; what is empty is not asked for. `images`: folder with VIEW.png.
absl::StatusOr<CellNow> ReadNow(const std::string& corners, const std::string& images,
                                const storage::v1::CellDescription& cell);

struct LiveLook {
  std::vector<std::string> boards;  // files of those whose tags stay in the cell; empty: no tags
  // Where the robot is parked; nothing: no images are asked for.
  std::optional<Configuration> parked;
  int sets = 5;  // of images, in which tags are looked for
};

// From the cell's cameras. NotFound if no tag of the boards is seen; Aborted if a stop was asked
// for; else the errors of files and cameras.
absl::StatusOr<CellNow> LookNow(const LiveLook& look, const Cell& cell);

}  // namespace silhouette
