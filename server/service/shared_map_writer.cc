#include "server/service/shared_map_writer.h"

#include <algorithm>
#include <string>
#include <utility>

#include "absl/strings/str_join.h"
#include "db/status/status_macros.h"
#include "server/scene/checker.h"
#include "server/service/messages.h"

namespace silhouette {

absl::StatusOr<std::unique_ptr<SharedMapWriter>> SharedMapWriter::Create(
    SharedMapSettings settings, absl::Duration max_age,
    const std::shared_ptr<const ServedDatabase>& database, const Policy& policy) {
  auto writer = std::unique_ptr<SharedMapWriter>(new SharedMapWriter(std::move(settings), max_age));
  RETURN_IF_ERROR(writer->Begin(database, policy));
  return writer;
}

SharedMapWriter::~SharedMapWriter() { Close(shared_map::Closed::kStopped); }

void SharedMapWriter::Close(shared_map::Closed why) {
  if (writer_) writer_->Close(why);
  writer_.reset();
  file_.reset();
}

absl::Status SharedMapWriter::Begin(const std::shared_ptr<const ServedDatabase>& database,
                                    const Policy& policy) {
  v1::GetDatabaseResponse message;
  ToMessage(*database, policy, &message);
  const std::string description = message.SerializeAsString();
  const shared_map::Layout layout{.tiles = database->grid().tiles(),
                                  .description_bytes = description.size()};
  ASSIGN_OR_RETURN(std::unique_ptr<SharedMapFile> file,
                   SharedMapFile::Create(settings_, layout.FileBytes(), file_.get()));
  std::optional<shared_map::Writer> writer(std::in_place, file->words(), layout, description,
                                           shared_map::ClockId::Ours());
  RETURN_IF_ERROR(file->Show());
  Close(shared_map::Closed::kReplaced);
  file_ = std::move(file);
  writer_ = std::move(writer);
  database_ = database;
  return absl::OkStatus();
}

shared_map::Stamp SharedMapWriter::StampOf(const Served& served, const Policy& policy,
                                           Reason blocked) const {
  shared_map::Stamp stamp{.reason = static_cast<uint64_t>(blocked)};
  if (served.scene == nullptr) return stamp;
  const Scene& scene = *served.scene;
  const absl::Duration taken = scene.arrived.running - scene.AgeAt(scene.arrived);
  stamp.scene = scene.id;
  stamp.scene_time = absl::ToUnixNanos(scene.oldest);
  stamp.taken = absl::ToInt64Nanoseconds(taken);
  stamp.valid_until = absl::ToInt64Nanoseconds(taken + max_age_);
  stamp.reason_after = static_cast<uint64_t>(Reason::kSceneStale);
  for (const AllowedRegion& region : served.regions->regions) {
    // At its end a region is in force no more.
    const int64_t last = absl::ToInt64Nanoseconds(region.end) - 1;
    if (last >= stamp.valid_until) continue;
    stamp.valid_until = last;
    stamp.reason_after = static_cast<uint64_t>(Reason::kRegionEnded);
  }
  if (served.trust != nullptr && RestsOnCalibration(policy) &&
      served.trust->until != absl::InfiniteDuration()) {
    const int64_t last = absl::ToInt64Nanoseconds(served.trust->until) - 1;
    if (last < stamp.valid_until) {
      stamp.valid_until = last;
      stamp.reason_after = static_cast<uint64_t>(Reason::kCalibrationDoubtful);
    }
  }
  return stamp;
}

shared_map::Cells SharedMapWriter::CellsOf(const ConfigurationSpace& space, const Policy& policy) {
  if (policy.off_grid != OffGrid::kCell) return shared_map::Cells::kNothing;
  for (uint64_t tile = 0; tile < space.tiles(); ++tile) {
    if (!space.cells_ready(tile)) return shared_map::Cells::kNothing;
  }
  return space.cells_exact() ? shared_map::Cells::kExact : shared_map::Cells::kSomeFree;
}

absl::Status SharedMapWriter::Publish(const Served& served, const Policy& policy,
                                      const ConfigurationSpace* space, Reason blocked) {
  // The variants have the same grid: a scene with another variant changes but the states.
  const std::shared_ptr<const ServedDatabase>& whole =
      served.whole != nullptr ? served.whole : served.database;
  if (database_.lock() != whole || !writer_) {
    if (absl::Status begun = Begin(whole, policy); !begun.ok()) {
      Close(shared_map::Closed::kReplaced);
      return begun;
    }
  }
  if (blocked == Reason::kNone && (space == nullptr || served.scene == nullptr)) {
    blocked = Reason::kInternal;
  }
  static const TileVerdicts unknown;
  const auto states = [space](uint64_t tile) -> shared_map::Writer::TileStates {
    const TileVerdicts& verdicts = space->ready(tile) ? space->tile(tile) : unknown;
    return {verdicts.free, verdicts.occupied, space->free_cells(tile).words};
  };
  shared_map::Stamp stamp = StampOf(served, policy, blocked);
  if (blocked == Reason::kNone) stamp.cells = CellsOf(*space, policy);
  writer_->Publish(
      stamp, absl::StrJoin(RegionsIn(served, policy), "\n"),
      blocked == Reason::kNone ? shared_map::Writer::Tiles(states) : shared_map::Writer::Tiles());
  return absl::OkStatus();
}

}  // namespace silhouette
