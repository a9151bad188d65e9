// SPDX-License-Identifier: Apache-2.0
#include "db/store/robot_images_in_place.h"

#include <optional>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "db/status/status_macros.h"
#include "db/store/raw_records.h"
#include "db/store/read_at.h"
#include "db/store/schema.h"

namespace silhouette {

// Calls `visit` for every record, as it is stored and as it is met.
class RecordWalk {
 public:
  using Visit = std::function<absl::Status(const RawRecord&, const MetRecord&)>;

  explicit RecordWalk(const Snapshot& snapshot) : snapshot_(*snapshot.impl_) {}

  absl::Status Go(const Visit& visit) {
    size_t room = 0;
    for (const MaskSize size : snapshot_.state->mask_sizes) room += size.words();
    words_.resize(room);
    return ForEachRecord(snapshot_.records(), {},
                         [&](const RawRecord& record) { return Meet(record, visit); });
  }

  const Snapshot::Impl& snapshot() const { return snapshot_; }

 private:
  absl::Status Meet(const RawRecord& record, const Visit& visit) {
    const std::optional<ConfigurationNumber> number = schema::DecodeKey(record.key);
    if (!number || !snapshot_.state->grid.Contains(*number)) {
      return absl::DataLossError(absl::StrCat("database '", snapshot_.state->path,
                                              "' has a robot image under a damaged key"));
    }
    const StoredMasks masks =
        DecodeMasks(*number, record.value, snapshot_.state->mask_sizes, words_, record.base);
    measured_.clear();
    absl::Time captured;
    if (masks == StoredMasks::kPresent) {
      ReadMeasured(record.value, measured_);
      captured = ReadCaptured(record.value);
    }
    return visit(record, {*number, masks, words_, measured_, captured});
  }

  Snapshot::Impl& snapshot_;
  std::vector<uint64_t> words_;
  std::vector<double> measured_;
};

absl::Status ForEachMasks(const Snapshot& snapshot, const VisitRecord& visit) {
  return RecordWalk(snapshot).Go([&](const RawRecord&, const MetRecord& record) {
    visit(record);
    return absl::OkStatus();
  });
}

RobotImagesInPlace::RobotImagesInPlace(std::shared_ptr<const Snapshot> snapshot)
    : snapshot_(std::move(snapshot)) {}

RobotImagesInPlace::~RobotImagesInPlace() = default;

absl::StatusOr<std::shared_ptr<const RobotImagesInPlace>> RobotImagesInPlace::Open(
    std::shared_ptr<const Snapshot> snapshot, const VisitRecord& visit) {
  RecordWalk walk(*snapshot);
  const DatabaseState& state = *walk.snapshot().state;
  std::shared_ptr<RobotImagesInPlace> images(new RobotImagesInPlace(std::move(snapshot)));
  images->mask_sizes_ = state.mask_sizes;
  images->tiles_.resize(state.grid.tiles());
  images->bases_.resize(state.grid.tiles());
  mdb_filehandle_t file = -1;
  if (const int code = mdb_env_get_fd(state.environment->get(), &file); code != 0) {
    return state.environment->ReadError(code);
  }
  images->file_ = file;
  const absl::Status status =
      walk.Go([&](const RawRecord& raw, const MetRecord& record) -> absl::Status {
        if (!raw.place || (!raw.base.empty() && !raw.base_place)) {
          return absl::FailedPreconditionError(absl::StrCat(
              "the robot images of '", state.path,
              "' cannot be read in place on this machine, whose pages are smaller than the file's; "
              "let them have more memory"));
        }
        if (record.masks == StoredMasks::kPresent) {
          Note(images->tiles_, record.number, *raw.place, raw.value.size());
          if (raw.base_place) {
            Note(images->bases_, record.number, *raw.base_place, raw.base.size());
          }
        }
        visit(record);
        return absl::OkStatus();
      });
  if (!status.ok()) return status;
  return images;
}

void RobotImagesInPlace::Note(Tiles& tiles, ConfigurationNumber number, uint64_t offset,
                              size_t size) {
  Tile& tile = tiles[number / kTileSize];
  if (tile.sizes.empty()) {
    tile.offsets.assign(kTileSize, 0);
    tile.sizes.assign(kTileSize, 0);
  }
  tile.offsets[number % kTileSize] = offset;
  tile.sizes[number % kTileSize] = static_cast<uint32_t>(size);  // LMDB's values are no larger
}

bool RobotImagesInPlace::ReadValue(const Tiles& tiles, ConfigurationNumber number,
                                   std::string& value) const {
  const uint64_t at = number / kTileSize;
  if (at >= tiles.size() || tiles[at].sizes.empty()) return false;
  const uint32_t size = tiles[at].sizes[number % kTileSize];
  if (size == 0) return false;
  value.resize(size);
  return ReadAt(file_, tiles[at].offsets[number % kTileSize], value);
}

bool RobotImagesInPlace::Read(ConfigurationNumber number, std::span<uint64_t> words) const {
  thread_local std::string value;
  thread_local std::string base;
  if (!ReadValue(tiles_, number, value)) return false;
  if (!NeedsBase(value)) {
    base.clear();
  } else if (!ReadValue(bases_, number, base)) {
    return false;
  }
  return DecodeMasks(number, value, mask_sizes_, words, base) == StoredMasks::kPresent;
}

}  // namespace silhouette
