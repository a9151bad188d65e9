// SPDX-License-Identifier: Apache-2.0
#include "server/service/space_writer.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <set>
#include <stdexcept>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/time/time.h"
#include "server/service/calls.h"
#include "server/service/messages.h"

namespace silhouette {

std::string PackedBits(std::span<const uint64_t> words, size_t bits) {
  static_assert(std::endian::native == std::endian::little);
  std::string bytes((bits + 7) / 8, '\0');
  std::memcpy(bytes.data(), words.data(), bytes.size());
  return bytes;
}

absl::StatusOr<std::vector<uint64_t>> TilesFrom(
    const google::protobuf::RepeatedField<uint64_t>& named, const ConfigurationGrid& grid) {
  std::vector<uint64_t> tiles;
  if (named.empty()) {
    for (uint64_t tile = 0; tile < grid.tiles(); ++tile) tiles.push_back(tile);
    return tiles;
  }
  std::set<uint64_t> seen;
  for (int i = 0; i < named.size(); ++i) {
    if (named[i] >= grid.tiles()) {
      return FieldError(absl::StrCat("tiles[", i, "]"),
                        absl::StrCat("there is no tile ", named[i], "; the grid has ", grid.tiles(),
                                     ", counted from 0"));
    }
    if (seen.insert(named[i]).second) tiles.push_back(named[i]);
  }
  return tiles;
}

void ToMessage(uint64_t tile, const TileVerdicts& verdicts, v1::ConfigurationSpaceTile* message) {
  message->set_tile(tile);
  message->set_free(PackedBits(verdicts.free, kTileSize));
  message->set_occupied(PackedBits(verdicts.occupied, kTileSize));
}

void AddCells(uint64_t tile, const ConfigurationSpace& space, v1::ConfigurationSpaceTile* message) {
  message->set_free_cells(PackedBits(space.free_cells(tile).words, kTileSize));
}

absl::StatusOr<Deadline> DeadlineOf(const v1::GetConfigurationSpaceRequest& request) {
  if (!request.has_max_time()) return Deadline::max();
  const absl::Duration time = DurationFrom(request.max_time());
  if (time < absl::ZeroDuration()) {
    return FieldError("max_time", "a time cannot be negative");
  }
  // Longer than any call lives.
  if (time > absl::Hours(24)) return Deadline::max();
  return std::chrono::steady_clock::now() + absl::ToChronoNanoseconds(time);
}

absl::StatusOr<std::vector<double>> ClearanceLevelsFrom(
    const v1::GetConfigurationSpaceRequest& request) {
  const std::vector<double> levels(request.clearance_levels().begin(),
                                   request.clearance_levels().end());
  if (levels.size() > kMaxClearanceLevels) {
    return FieldError("clearance_levels", absl::StrCat("there are ", levels.size(),
                                                       "; ask for at most ", kMaxClearanceLevels));
  }
  try {
    if (!levels.empty()) RequireLevels(levels);
  } catch (const std::invalid_argument& error) {
    return FieldError("clearance_levels", absl::StrCat("", error.what()));
  }
  return levels;
}

std::shared_ptr<SpaceWriter> SpaceWriter::Start(grpc::CallbackServerContext* context,
                                                Clients::Place place, absl::Duration longest_write,
                                                WatchHub& watches) {
  const std::shared_ptr<SpaceWriter> writer(
      new SpaceWriter(context, std::move(place), longest_write));
  writer->self_ = writer;
  watches.Add(writer);
  return writer;
}

void SpaceWriter::Tell(uint64_t) {
  const std::lock_guard lock(mutex_);
  if (write_end_ && Clock::now() > *write_end_) context_->TryCancel();
}

void SpaceWriter::OnDone() {
  place_.reset();
  {
    const std::lock_guard lock(mutex_);
    write_end_.reset();
  }
  const std::shared_ptr<SpaceWriter> last = std::move(self_);  // perhaps a worker still holds it
}

void SpaceWriter::Send(v1::GetConfigurationSpaceResponse first,
                       std::shared_ptr<const ConfigurationSpace> space,
                       std::shared_ptr<const ClearanceSpace> clearances, bool cells,
                       std::vector<uint64_t> tiles) {
  message_ = std::move(first);
  space_ = std::move(space);
  clearances_ = std::move(clearances);
  cells_ = cells;
  tiles_ = std::move(tiles);
  SendNext();
}

void SpaceWriter::OnWriteDone(bool ok) {
  {
    const std::lock_guard lock(mutex_);
    write_end_.reset();
  }
  if (!ok) {
    Finish(grpc::Status::CANCELLED);  // the caller is gone
  } else if (next_ == tiles_.size()) {
    Finish(grpc::Status::OK);
  } else {
    message_.Clear();
    SendNext();
  }
}

void SpaceWriter::SendNext() {
  const size_t more =
      (clearances_ != nullptr ? clearances_->levels().size() : 0) + (cells_ ? 1 : 0);
  const size_t end = std::min(tiles_.size(), next_ + 2 * kTilesPerMessage / (2 + more));
  for (; next_ < end; ++next_) {
    v1::ConfigurationSpaceTile& tile = *message_.add_tiles();
    ToMessage(tiles_[next_], space_->tile(tiles_[next_]), &tile);
    if (cells_) AddCells(tiles_[next_], *space_, &tile);
    if (clearances_ == nullptr) continue;
    for (const PlaceSet& above : clearances_->tile(tiles_[next_])) {
      tile.add_clearances(PackedBits(above.words, kTileSize));
    }
  }
  WriteMessage(message_, &bytes_);
  {
    const std::lock_guard lock(mutex_);
    write_end_ = Clock::now() + absl::ToChronoNanoseconds(longest_write_);
  }
  StartWrite(&bytes_);
}

}  // namespace silhouette
