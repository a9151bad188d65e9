// SPDX-License-Identifier: Apache-2.0
// The robot images of one state of the database, read from its file when they are needed: for
// databases whose images do not fit into memory.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "db/mask/mask.h"
#include "db/store/robot_image_format.h"
#include "db/store/store.h"

namespace silhouette {

// A record as it is met. If `masks` is kPresent, `words` are those of all its masks, one view after
// another, `measured` is RobotImage::measured, both valid until the next record, and `captured` is
// RobotImage::captured.
struct MetRecord {
  ConfigurationNumber number = 0;
  StoredMasks masks = StoredMasks::kDamaged;
  std::span<const uint64_t> words;
  std::span<const double> measured;
  absl::Time captured;
};
using VisitRecord = std::function<void(const MetRecord&)>;

// Calls `visit` for every record of the state, in the order of numbers: what Snapshot::ForEach
// does, for masks alone and in less time. DataLoss: a record lies under a key that is damaged.
absl::Status ForEachMasks(const Snapshot& snapshot, const VisitRecord& visit);

// For any number of threads, which neither wait for each other nor use LMDB. It keeps the place of
// every record in the file (12 bytes per configuration of a tile that has records). The file is
// read, not mapped: damage makes a record unreadable and does not end the process.
//
// While it lives, so does its snapshot: see CollisionIndex (collision_index.h) for what that costs.
class RobotImagesInPlace {
 public:
  // Reads all records once and calls `visit` for each of them, as ForEachMasks does.
  // FailedPrecondition: the places of records in the file cannot be found, because the file has
  // larger pages than this machine.
  static absl::StatusOr<std::shared_ptr<const RobotImagesInPlace>> Open(
      std::shared_ptr<const Snapshot> snapshot, const VisitRecord& visit);
  ~RobotImagesInPlace();
  RobotImagesInPlace(const RobotImagesInPlace&) = delete;
  RobotImagesInPlace& operator=(const RobotImagesInPlace&) = delete;

  // Reads the masks of a configuration into `words`, which has just the room, one view after
  // another. False if it has none, or its record cannot be read, or fails its checksum by now.
  // Allocates nothing but memory that a thread keeps.
  bool Read(ConfigurationNumber number, std::span<uint64_t> words) const;

 private:
  // Of the records of a tile, by their place in it; a size of 0: there is no such record.
  struct Tile {
    std::vector<uint64_t> offsets;
    std::vector<uint32_t> sizes;
  };
  using Tiles = std::vector<Tile>;

  explicit RobotImagesInPlace(std::shared_ptr<const Snapshot> snapshot);
  static void Note(Tiles& tiles, ConfigurationNumber number, uint64_t offset, size_t size);
  // False if there is nothing of the number, or it cannot be read.
  bool ReadValue(const Tiles& tiles, ConfigurationNumber number, std::string& value) const;

  const std::shared_ptr<const Snapshot> snapshot_;
  std::vector<MaskSize> mask_sizes_;
  int file_ = -1;
  Tiles tiles_;
  Tiles bases_;  // of those that rest on others
};

}  // namespace silhouette
