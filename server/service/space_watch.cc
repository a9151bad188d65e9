#include "server/service/space_watch.h"

#include <algorithm>
#include <utility>

#include "db/status/status_macros.h"
#include "server/service/answers.h"
#include "server/service/messages.h"
#include "server/service/space_writer.h"

namespace silhouette {

absl::StatusOr<bool> SpaceWatch::Prepare() {
  ASSIGN_OR_RETURN(
      const Served found,
      WithVariant(serving().scenes.Newest(serving().settings.clock()), request_.variant()));
  const Served& served = found;
  ASSIGN_OR_RETURN(const Policy policy, PolicyFor(serving(), request_.policy(), *served.database));
  ASSIGN_OR_RETURN(const std::vector<uint64_t> tiles,
                   TilesFrom(request_.tiles(), served.database->grid()));
  const bool cells = TellsCells(request_.include_cells(), policy);
  std::shared_ptr<const ConfigurationSpace> space;
  if (served.scene != nullptr) {
    space = serving().spaces.Get(served, policy);
    for (const uint64_t tile : tiles) {
      if (cancelled()) return absl::CancelledError();
      space->tile(tile);
    }
    if (cells && !space->WorkOutCells(tiles, [this] { return cancelled(); })) {
      return absl::CancelledError();
    }
  }
  v1::WatchConfigurationSpaceResponse first;
  absl::Duration valid_for;
  const Reason blocked = Conclude(serving(), served, policy, first.mutable_basis(), &valid_for);
  if (serving().scenes.database() != served.whole) return Prepare();  // it was replaced
  const WatchedState state(served, blocked);
  if (state == told_of_) return false;
  if (state.database != told_of_.database || cells != cells_) {
    first.set_whole(true);
    ToMessage(served.database->grid(), first.mutable_grid());
    sent_ = nullptr;
  }
  first.set_unknown_reason(ToMessage(blocked));
  ToMessage(valid_for, first.mutable_valid_for());
  first.set_skipped_scenes(ScenesSkipped(last_scene_, state.scene));
  changed_.clear();
  if (blocked == Reason::kNone) {
    first.set_cells_exact(cells && space->cells_exact());
    std::ranges::copy_if(tiles, std::back_inserter(changed_), [&](uint64_t tile) {
      if (sent_ == nullptr) return space->tile(tile) != TileVerdicts();
      return space->tile(tile) != sent_->tile(tile) ||
             (cells && space->free_cells(tile) != sent_->free_cells(tile));
    });
    sent_ = std::move(space);
  }
  told_of_ = state;
  cells_ = cells;
  last_scene_ = std::max(last_scene_, state.scene);
  first_ = std::move(first);
  next_ = 0;
  return true;
}

bool SpaceWatch::NextPart(v1::WatchConfigurationSpaceResponse& part) {
  if (next_ == 0) part = std::move(first_);
  const size_t end = std::min(changed_.size(), next_ + kTilesPerPart);
  for (; next_ < end; ++next_) {
    v1::ConfigurationSpaceTile& tile = *part.add_tiles();
    ToMessage(changed_[next_], sent_->tile(changed_[next_]), &tile);
    if (cells_) AddCells(changed_[next_], *sent_, &tile);
  }
  part.set_last_part(next_ == changed_.size());
  return !part.last_part();
}

}  // namespace silhouette
