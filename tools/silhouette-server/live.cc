// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-server/live.h"

#include <algorithm>
#include <optional>
#include <stdexcept>
#include <thread>
#include <utility>
#include <vector>

#include "capture/session/travel.h"
#include "db/status/status_macros.h"
#include "tools/cell/devices/cell_devices.h"

namespace silhouette {

std::shared_ptr<LiveRecord> NewLiveRecord(const Cell& cell) {
  std::vector<std::string> views;
  for (const ViewSettings& view : cell.views) views.push_back(view.name);
  const std::string& variant = cell.server.live.variant;
  return std::make_shared<LiveRecord>(views, cell.server.scene.max_age, SystemClock,
                                      variant.empty() ? KnownVariant() : KnownVariant(variant));
}

absl::StatusOr<std::unique_ptr<LiveLoop>> StartLive(const Cell& cell, const std::string& obstacles,
                                                    std::shared_ptr<LiveRecord> record,
                                                    Server& server) {
  std::optional<Travel> travel;
  try {
    travel.emplace(cell.grid, cell.capture.forbidden_regions);
  } catch (const std::invalid_argument& error) {
    return absl::InvalidArgumentError(cell.file + ": " + error.what());
  }
  ASSIGN_OR_RETURN(CellOpeners openers, OpenersOf(cell, *travel, obstacles));
  LiveConfig config{
      .live = cell.server.live, .scene = cell.server.scene, .segmentation = cell.segmentation};
  config.live.threads = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
  return LiveLoop::Start(
      config, {.open_cameras = std::move(openers.cameras), .open_robot = std::move(openers.robot)},
      {.database = [&server] { return server.database(); },
       .publish = [&server](
                      Scene scene,
                      const auto& database) { return server.Publish(std::move(scene), database); }},
      std::move(record));
}

}  // namespace silhouette
