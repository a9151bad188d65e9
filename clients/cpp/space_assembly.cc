// SPDX-License-Identifier: Apache-2.0
#include "clients/cpp/space_assembly.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "silhouette/messages.h"

namespace silhouette::client {

absl::StatusOr<std::optional<SpaceUpdate>> SpaceAssembly::Add(
    const v1::WatchConfigurationSpaceResponse& part) {
  const bool first = !begun_.has_value();
  absl::Status status;
  if (first) {
    status = Begin(part);
  } else if (part.has_basis() || part.has_grid() || part.whole() || part.has_robot() ||
             part.planes_size() > 0) {
    status = absl::InternalError("an update begins before the previous one has ended");
  }
  if (!status.ok()) return status;
  if (begun_->unknown && part.tiles_size() > 0) {
    return absl::InternalError("an update that makes everything unknown has tiles");
  }
  for (const v1::ConfigurationSpaceTile& tile : part.tiles()) {
    status = Take(tile);
    if (!status.ok()) return status;
  }
  if (!part.last_part()) return std::nullopt;
  last_ = std::move(map_);
  generation_ = begun_->basis.database_generation();
  begun_->map = last_;
  return std::exchange(begun_, std::nullopt);
}

absl::Status SpaceAssembly::Begin(const v1::WatchConfigurationSpaceResponse& first) {
  if (!first.has_basis()) return absl::InternalError("an update has no basis");
  const uint64_t scene = first.basis().scene_id();
  if (last_scene_ != 0 && scene > last_scene_ + 1 + first.skipped_scenes()) {
    return absl::InternalError(absl::StrCat("the update of scene ", last_scene_ + 1,
                                            " or of a later one, before ", scene, ", is missing"));
  }
  last_scene_ = std::max(last_scene_, scene);
  if (first.whole() != first.has_grid()) {
    return absl::InternalError("a grid belongs to an update that is whole, and to no other");
  }
  SpaceUpdate update{
      .basis = first.basis(), .whole = first.whole(), .skipped_scenes = first.skipped_scenes()};
  if (first.basis().scene_id() == 0) update.unknown = Reason::kNoScene;
  if (first.unknown_reason() != 0) update.unknown = FromMessage(first.unknown_reason());
  if (first.whole()) {
    absl::StatusOr<ConfigurationGrid> grid = FromMessage(first.grid());
    if (!grid.ok()) return grid.status();
    if (grid->tiles() > SpaceMap::kMostTiles) {
      return absl::ResourceExhaustedError(absl::StrCat("the grid has ", grid->tiles(),
                                                       " tiles; at most ", SpaceMap::kMostTiles,
                                                       " can be held"));
    }
    map_ = std::make_shared<SpaceMap>(SpaceMap{.grid = *std::move(grid), .tiles = {}});
    map_->tiles.resize(map_->grid.tiles());
  } else if (last_ == nullptr) {
    return absl::InternalError("the first update is not whole");
  } else if (first.basis().database_generation() != generation_) {
    return absl::InternalError("the database changed, and the update is not whole");
  } else {
    map_ = std::make_shared<SpaceMap>(*last_);
  }
  map_->cells_exact = first.cells_exact();
  came_.assign(map_->tiles.size(), false);
  begun_ = std::move(update);
  const absl::Status status = TakeRobot(first);
  return status.ok() ? TakePlanes(first) : status;
}

absl::Status SpaceAssembly::TakeRobot(const v1::WatchConfigurationSpaceResponse& first) {
  if (!first.whole()) {
    if (!first.has_robot()) return absl::OkStatus();
    return absl::InternalError("a robot belongs to an update that is whole, and to no other");
  }
  robot_ = nullptr;
  if (!first.has_robot()) return absl::OkStatus();
  absl::StatusOr<std::shared_ptr<const ServedRobot>> robot = FromMessage(first.robot(), map_->grid);
  if (!robot.ok()) return robot.status();
  robot_ = *std::move(robot);
  return absl::OkStatus();
}

absl::Status SpaceAssembly::TakePlanes(const v1::WatchConfigurationSpaceResponse& first) {
  if (begun_->unknown || robot_ == nullptr) {
    if (first.planes_size() == 0) return absl::OkStatus();
    return absl::InternalError(begun_->unknown
                                   ? "an update that makes everything unknown has planes"
                                   : "an update has planes, and no robot was sent");
  }
  absl::StatusOr<std::shared_ptr<const DrawnSpace>> drawn = DrawnSpace::FromMessage(robot_, first);
  if (!drawn.ok()) return drawn.status();
  begun_->drawn = *std::move(drawn);
  return absl::OkStatus();
}

absl::Status SpaceAssembly::Take(const v1::ConfigurationSpaceTile& message) {
  absl::StatusOr<ConfigurationSpaceTile> tile = FromMessage(message);
  if (!tile.ok()) return tile.status();
  if (tile->tile >= came_.size()) {
    return absl::InternalError(
        absl::StrCat("tile ", tile->tile, " is beyond the grid's ", came_.size()));
  }
  if (came_[tile->tile]) {
    return absl::InternalError(absl::StrCat("tile ", tile->tile, " comes twice in an update"));
  }
  came_[tile->tile] = true;
  MakeConsistent(map_->grid, *tile);
  map_->tiles[tile->tile] = std::make_shared<const ConfigurationSpaceTile>(*tile);
  ++begun_->tiles_changed;
  return absl::OkStatus();
}

}  // namespace silhouette::client
