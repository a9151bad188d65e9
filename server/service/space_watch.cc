#include "server/service/space_watch.h"

#include <algorithm>
#include <utility>

#include "server/service/answers.h"
#include "server/service/messages.h"
#include "server/service/space_writer.h"

namespace silhouette {

absl::StatusOr<bool> SpaceWatch::Prepare() {
  const Served served = serving().scenes.Newest(serving().settings.clock());
  const absl::StatusOr<Policy> policy = PolicyFor(serving(), request_.policy(), *served.database);
  if (!policy.ok()) return policy.status();
  const absl::StatusOr<std::vector<uint64_t>> tiles =
      TilesFrom(request_.tiles(), served.database->grid());
  if (!tiles.ok()) return tiles.status();
  std::shared_ptr<const ConfigurationSpace> space;
  if (served.scene != nullptr) {
    space = serving().spaces.Get(served, *policy);
    for (const uint64_t tile : *tiles) {
      if (cancelled()) return absl::CancelledError();
      space->tile(tile);
    }
  }
  v1::WatchConfigurationSpaceResponse first;
  absl::Duration valid_for;
  const Reason blocked = Conclude(serving(), served, *policy, first.mutable_basis(), &valid_for);
  if (serving().scenes.database() != served.database) return Prepare();  // it was replaced
  const WatchedState state(served, blocked);
  if (state == told_of_) return false;
  if (state.database != told_of_.database) {
    first.set_whole(true);
    ToMessage(served.database->grid(), first.mutable_grid());
    sent_ = nullptr;
  }
  first.set_unknown_reason(ToMessage(blocked));
  ToMessage(valid_for, first.mutable_valid_for());
  first.set_skipped_scenes(ScenesSkipped(last_scene_, state.scene));
  changed_.clear();
  if (blocked == Reason::kNone) {
    std::ranges::copy_if(*tiles, std::back_inserter(changed_), [&](uint64_t tile) {
      return space->tile(tile) != (sent_ == nullptr ? TileVerdicts() : sent_->tile(tile));
    });
    sent_ = std::move(space);
  }
  told_of_ = state;
  last_scene_ = std::max(last_scene_, state.scene);
  first_ = std::move(first);
  next_ = 0;
  return true;
}

bool SpaceWatch::NextPart(v1::WatchConfigurationSpaceResponse& part) {
  if (next_ == 0) part = std::move(first_);
  const size_t end = std::min(changed_.size(), next_ + kTilesPerPart);
  for (; next_ < end; ++next_)
    ToMessage(changed_[next_], sent_->tile(changed_[next_]), part.add_tiles());
  part.set_last_part(next_ == changed_.size());
  return !part.last_part();
}

}  // namespace silhouette
