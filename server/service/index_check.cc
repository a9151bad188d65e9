// SPDX-License-Identifier: Apache-2.0
#include "server/service/index_check.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <exception>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "db/status/status_macros.h"
#include "server/collision/collision_checker.h"
#include "server/scene/checker.h"
#include "server/service/serving.h"

namespace silhouette {
namespace {

// The index that maps rest on, or one of the two that those of nodes do; null: there is none.
const CollisionIndex* IndexOfMaps(const ServedDatabase& database) {
  return database.index() != nullptr ? database.index() : database.node_index(DrawnKind::kReach);
}

// Some configuration that has a robot image; nothing if its tile has none. Of drawn ones, those of
// the index.
std::optional<ConfigurationNumber> SomeConfiguration(const ServedDatabase& database,
                                                     std::mt19937_64& random) {
  const uint64_t tile = random() % database.grid().tiles();
  PlaceSet present;
  if (database.robot_images().drawn() == nullptr) {
    present = database.robot_images().present(tile);
  } else if (const TileIndex* index = IndexOfMaps(database)->Tile(tile)) {
    present = index->present();
  }
  if (present.Empty()) return std::nullopt;
  uint64_t place = random() % kTileSize;
  while (!present.Contains(place)) place = (place + 1) % kTileSize;
  return tile * kTileSize + place;
}

absl::Status Differs(ConfigurationNumber number, State in_map, State by_images) {
  return absl::DataLossError(absl::StrCat("configuration ", number, " is ", NameOf(in_map),
                                          " in the map and ", NameOf(by_images),
                                          " by its robot images"));
}

}  // namespace

void IndexCheck::Start() {
  thread_ = std::jthread([this](const std::stop_token& stop) { Run(stop); });
}

void IndexCheck::Run(const std::stop_token& stop) {
  uint64_t seen = 0;
  auto last = std::chrono::steady_clock::now();
  while (!stop.stop_requested()) {
    seen = scenes_.WaitForChange(seen, kPeriod, stop);
    const auto now = std::chrono::steady_clock::now();
    try {
      Look(absl::FromChrono(now - std::exchange(last, now)));
    } catch (const std::exception& error) {
      spdlog::error("internal error: {}", error.what());
    }
  }
}

void IndexCheck::Look(absl::Duration passed) {
  const std::shared_ptr<const ServedDatabase> database = scenes_.database();
  if (database_.lock() != database) Begin(database);
  if (tiles_.empty() || database->damage().found()) return;
  absl::Status status = CheckTiles(passed);
  if (status.ok()) status = CompareMap(database);
  if (status.ok() || !database->damage().Note(std::string(status.message()))) return;
  spdlog::error(
      "nothing is free: {}; replace the database's whole folder by a copy that 'silhouette-db "
      "verify' accepts, and reload it (SIGHUP)",
      std::string(status.message()));
}

void IndexCheck::Begin(const std::shared_ptr<const ServedDatabase>& database) {
  database_ = database;
  tiles_.clear();
  next_ = 0;
  for (const std::string& name : database->variants()) {
    const ServedDatabase& variant = *database->Variant(name);
    for (const CollisionIndex* index : {variant.index(), variant.node_index(DrawnKind::kOwn),
                                        variant.node_index(DrawnKind::kReach)}) {
      if (index == nullptr) continue;
      for (const uint64_t tile : index->Tiles()) tiles_.push_back({index, tile});
    }
  }
}

absl::Status IndexCheck::CheckTiles(absl::Duration passed) {
  // A tile may take more than there is, and the next look less.
  const auto rate = static_cast<double>(settings_.index_check.rate);
  credit_ = std::min(rate, credit_ + rate * absl::ToDoubleSeconds(passed));
  for (size_t i = 0; i < tiles_.size() && credit_ > 0; ++i) {
    const Tile& tile = tiles_[next_];
    next_ = (next_ + 1) % tiles_.size();
    ASSIGN_OR_RETURN(const uint64_t bytes, tile.index->CheckAgain(tile.tile));
    credit_ -= static_cast<double>(bytes);
    bytes_ += bytes;
  }
  return absl::OkStatus();
}

absl::Status IndexCheck::CompareMap(const std::shared_ptr<const ServedDatabase>& whole) {
  const Moment now = settings_.clock();
  ASSIGN_OR_RETURN(const Served served, WithVariant(scenes_.Newest(now), /*name=*/""));
  const ServedDatabase& database = *served.database;
  const Policy policy = DefaultPolicy(settings_, database);
  if (served.whole != whole || IndexOfMaps(database) == nullptr ||
      !database.CanServe(policy).ok() ||
      BlockedReason(served, policy, settings_.scene, now) != Reason::kNone) {
    return absl::OkStatus();
  }
  const std::shared_ptr<const ConfigurationSpace> space = spaces_.Get(served, policy);
  const CollisionChecker by_images(database.robot_images(), served.scene->obstacle_images, policy,
                                   SupportFor(served, policy));
  for (int i = 0; i < settings_.index_check.samples; ++i) {
    const auto number = SomeConfiguration(database, random_);
    // Where a map is not a look into the index, it is not worked out for this.
    const uint64_t tile = number.value_or(0) / kTileSize;
    if (!number || !(space->ready(tile) || space->looked_up(tile))) continue;
    const State in_map = space->state(*number);
    if (in_map == State::kUnknown) continue;
    const Verdict expected = by_images.Check(*number);
    // They could be read when the database was loaded.
    if (expected.reason() == Reason::kRobotImageCorrupt) {
      return absl::DataLossError(absl::StrCat("configuration ", *number, " is ", NameOf(in_map),
                                              " in the map, and its robot images can no longer be "
                                              "read"));
    }
    if (expected.state() == State::kUnknown) continue;
    if (in_map != expected.state()) return Differs(*number, in_map, expected.state());
    ++compared_;
  }
  return absl::OkStatus();
}

}  // namespace silhouette
