// SPDX-License-Identifier: Apache-2.0
#include "db/store/shards.h"

#include "absl/strings/str_cat.h"
#include "db/status/status_macros.h"
#include "db/store/database_state.h"
#include "db/store/store.h"

namespace silhouette {

uint64_t ConfigurationsIn(const ConfigurationGrid& grid, uint64_t tile) {
  uint64_t count = 0;
  for (uint64_t place = 0; place < kTileSize; ++place) {
    count += grid.Contains(tile * kTileSize + place) ? 1 : 0;
  }
  return count;
}

uint64_t ConfigurationsOf(const storage::v1::DrawnImages& drawn, const ConfigurationGrid& grid) {
  if (drawn.shards() < 2) return grid.size();
  uint64_t count = 0;
  for (uint64_t tile = 0; tile < grid.tiles(); ++tile) {
    if (HasTile(drawn, tile)) count += ConfigurationsIn(grid, tile);
  }
  return count;
}

std::string NameOfShard(const storage::v1::DrawnImages& drawn) {
  return absl::StrCat(drawn.shard(), " of ", drawn.shards());
}

std::string DrawnDifference(const storage::v1::DrawnImages& a, const storage::v1::DrawnImages& b) {
  if (a.tolerance() != b.tolerance()) {
    return absl::StrCat("another tolerance (", a.tolerance(), " m, ", b.tolerance(), " m)");
  }
  if (a.digest() != b.digest()) {
    return absl::StrCat("another model, calibration, margin or link growth (digest ", a.digest(),
                        ", ", b.digest(), ")");
  }
  if (a.forbidden() != b.forbidden()) return "other forbidden regions";
  return "";
}

absl::Status Database::SetDrawnImages(const storage::v1::DrawnImages& drawn,
                                      const std::string& program) {
  ASSIGN_OR_RETURN(const Snapshot snapshot, Read());
  ASSIGN_OR_RETURN(const auto present, snapshot.DrawnImages());
  const std::string named = absl::StrCat("database '", path(), "'");
  if (!present && snapshot.size() > 0) {
    return absl::FailedPreconditionError(
        absl::StrCat(named, " has captured robot images; draw into a new database, with --from '",
                     path(), "' for its calibration"));
  }
  if (!present) {
    return ChangeMeta(state_->places.drawn_key, drawn.SerializeAsString(), program);
  }
  if (const std::string difference = DrawnDifference(*present, drawn); !difference.empty()) {
    return absl::FailedPreconditionError(absl::StrCat(named,
                                                      " has robot images that were drawn from ",
                                                      difference, "; draw into a new database"));
  }
  if (present->shard() != drawn.shard() || present->shards() != drawn.shards()) {
    return absl::FailedPreconditionError(absl::StrCat(named, " is shard ", NameOfShard(*present),
                                                      ", not ", NameOfShard(drawn),
                                                      "; draw each shard into its own database"));
  }
  return absl::OkStatus();
}

}  // namespace silhouette
