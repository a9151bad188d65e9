// SPDX-License-Identifier: Apache-2.0
#include "capture/session/drawn_images.h"

#include <algorithm>
#include <utility>

#include "calib/robot/drawing/drawn_kind.h"
#include "common/parallel/parallel.h"
#include "db/status/status_macros.h"
#include "db/store/shards.h"

namespace silhouette {
namespace {

// One run of DrawInto.
class GridDrawing {
 public:
  GridDrawing(const Database& database, const DrawMasks& draw, const DrawSettings& settings,
              RobotImageWriter& writer, DrawReport& report)
      : database_(database), draw_(draw), settings_(settings), writer_(writer), report_(report) {}

  absl::Status DrawTile(uint64_t tile) {
    ASSIGN_OR_RETURN(const std::vector<ConfigurationNumber> missing, MissingOf(tile));
    std::vector<RobotImage> images(missing.size());
    // Few configurations at a time are not worth handing to a thread.
    constexpr size_t kTogether = 64;
    ParallelFor((missing.size() + kTogether - 1) / kTogether,
                [&](size_t part) {
                  const size_t end = std::min(missing.size(), (part + 1) * kTogether);
                  for (size_t i = part * kTogether; i < end; ++i) images[i] = Draw(missing[i]);
                },
                settings_.most_threads);
    for (const RobotImage& image : images) {
      RETURN_IF_ERROR(writer_.Put(image, /*replace=*/true));
      ++report_.drawn;
      report_.excluded += image.excluded ? 1 : 0;
    }
    return writer_.Commit();
  }

 private:
  // The configurations of the tile without a record, or with a damaged one.
  absl::StatusOr<std::vector<ConfigurationNumber>> MissingOf(uint64_t tile) {
    ASSIGN_OR_RETURN(const Snapshot snapshot, database_.Read());
    std::vector<ConfigurationNumber> missing;
    for (ConfigurationNumber number = tile * kTileSize; number < (tile + 1) * kTileSize; ++number) {
      if (!database_.grid().Contains(number)) continue;
      const auto there = snapshot.Find(number);
      if (!there.ok() && !absl::IsDataLoss(there.status())) return there.status();
      report_.damaged += there.ok() ? 0 : 1;
      if (there.ok() && *there) {
        ++report_.kept;
      } else {
        missing.push_back(number);
      }
    }
    return missing;
  }

  RobotImage Draw(ConfigurationNumber number) const {
    RobotImage image;
    image.number = number;
    std::optional<std::vector<Mask>> masks = draw_(database_.grid().At(number));
    image.excluded = !masks;
    if (masks) image.masks = *std::move(masks);
    return image;
  }

  const Database& database_;
  const DrawMasks& draw_;
  const DrawSettings& settings_;
  RobotImageWriter& writer_;
  DrawReport& report_;
};

}  // namespace

DrawMasks WholeRobot(std::shared_ptr<const DrawnRobot> robot, JointRegions forbidden) {
  return [robot = std::move(robot), forbidden = std::move(forbidden)](
             std::span<const double> q) -> std::optional<std::vector<Mask>> {
    if (!robot->chain().Contains(q) || forbidden.Between(q, q)) {
      return std::nullopt;
    }
    return robot->Touched(q);
  };
}

DrawMasks ArmNodes(std::shared_ptr<const DrawnRobot> robot, ConfigurationGrid grid,
                   JointRegions forbidden) {
  return [robot = std::move(robot), grid = std::move(grid), forbidden = std::move(forbidden)](
             std::span<const double> q) -> std::optional<std::vector<Mask>> {
    const NodeCell cell = CellOf(grid, {q.begin(), q.end()});
    if (forbidden.Between(cell.from, cell.to)) return std::nullopt;
    return robot->Touched(q);
  };
}

absl::StatusOr<DrawReport> DrawInto(Database& database, const storage::v1::DrawnImages& drawn,
                                    const DrawMasks& draw, const DrawSettings& settings) {
  RETURN_IF_ERROR(database.SetDrawnImages(drawn, settings.program));
  ASSIGN_OR_RETURN(RobotImageWriter writer, database.Write(settings.program));
  DrawReport report{.configurations = ConfigurationsOf(drawn, database.grid())};
  GridDrawing drawing(database, draw, settings, writer, report);
  for (uint64_t tile = 0; tile < database.grid().tiles(); ++tile) {
    if (!HasTile(drawn, tile)) continue;
    if (settings.progress && !settings.progress(report)) {
      report.stopped = true;
      break;
    }
    RETURN_IF_ERROR(drawing.DrawTile(tile));
  }
  if (settings.progress && !report.stopped) settings.progress(report);
  return report;
}

}  // namespace silhouette
