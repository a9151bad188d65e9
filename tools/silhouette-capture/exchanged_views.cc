// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-capture/exchanged_views.h"

#include <algorithm>
#include <optional>

#include "absl/strings/str_format.h"
#include "capture/segmentation/difference.h"
#include "capture/session/cell_cameras.h"
#include "capture/session/cell_robot.h"
#include "capture/session/reference_images.h"
#include "db/status/status_macros.h"
#include "tools/cell/expected_robot.h"

namespace silhouette {
namespace {

constexpr int kLongestSideOfMask = 160;
// What foreground and drawn robot have in common, of all pixels of either: at least this in the
// other view, and no more than such a share of that in the view itself. Right calibrations have 0.9
// in the view itself; cables, tools and shadows lower both.
constexpr double kLeastInOther = 0.5;
constexpr double kMostInOwn = 0.8;

MaskSize CoarseSize(const ViewSettings& view) {
  const int scale = (std::max(view.image_width, view.image_height) - 1) / kLongestSideOfMask + 1;
  return {view.image_width / scale, view.image_height / scale};
}

double InCommon(const Mask& a, const Mask& b) {
  const size_t all = (a | b).Count();
  return all == 0 ? 0 : static_cast<double>((a & b).Count()) / static_cast<double>(all);
}

}  // namespace

absl::StatusOr<std::vector<std::string>> ExchangedViews(const Cell& cell, const Database& database,
                                                        Robot& robot, CameraRig& cameras) {
  std::vector<std::string> sentences;
  std::vector<MaskSize> sizes;
  for (const ViewSettings& view : cell.views) sizes.push_back(CoarseSize(view));
  const auto references = ReadReferences(database);
  if (absl::IsNotFound(references.status())) return sentences;
  if (!references.ok()) return references.status();
  ASSIGN_OR_RETURN(const auto expected,
                   ExpectedRobotOf(cell, database, sizes, "whether views are exchanged"));
  if (!expected) return sentences;
  ASSIGN_OR_RETURN(CellRobot cell_robot, CellRobot::Create(database.cell(), robot));
  ASSIGN_OR_RETURN(CellCameras cell_cameras, CellCameras::Create(database.cell(), cameras, {}));
  ASSIGN_OR_RETURN(const std::vector<double> joints, cell_robot.Measure());
  ASSIGN_OR_RETURN(const ImageSet set, cell_cameras.Grab([](const std::string&) {}));
  const std::vector<Mask> drawn = expected->Touched(joints);
  std::vector<Mask> seen;
  for (size_t view = 0; view < sizes.size(); ++view) {
    seen.push_back(
        RobotMask(set.images[view], (*references)[view], cell.segmentation, sizes[view]));
  }
  for (size_t a = 0; a < sizes.size(); ++a) {
    for (size_t b = a + 1; b < sizes.size(); ++b) {
      if (sizes[a] != sizes[b]) continue;
      const double other = std::min(InCommon(seen[a], drawn[b]), InCommon(seen[b], drawn[a]));
      const double own = std::max(InCommon(seen[a], drawn[a]), InCommon(seen[b], drawn[b]));
      if (other < kLeastInOther || own > kMostInOwn * other) continue;
      sentences.push_back(absl::StrFormat(
          "the views '%s' and '%s' are exchanged: in each the robot is where camera model and URDF "
          "have it in the other (%.0f %% of the pixels in common, %.0f %% with its own); exchange "
          "their sources in the cell file and take the reference images again, or exchange their "
          "camera models",
          cell.views[a].name, cell.views[b].name, 100 * other, 100 * own));
    }
  }
  return sentences;
}

}  // namespace silhouette
