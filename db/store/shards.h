// SPDX-License-Identifier: Apache-2.0
// Robot images that were drawn, in one database or in shards: databases of the same cell that have
// some of its tiles each, drawn by as many processes.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "db/mask/configuration_grid.h"
#include "silhouette/storage/v1/storage.pb.h"

namespace silhouette {

// Whether a database has this tile of the grid.
inline bool HasTile(const storage::v1::DrawnImages& drawn, uint64_t tile) {
  return drawn.shards() < 2 || tile % drawn.shards() == drawn.shard();
}

// How many configurations a tile of the grid has.
uint64_t ConfigurationsIn(const ConfigurationGrid& grid, uint64_t tile);

// How many configurations of the grid it has.
uint64_t ConfigurationsOf(const storage::v1::DrawnImages& drawn, const ConfigurationGrid& grid);

// "3 of 8": which shard it is, counted from 0.
std::string NameOfShard(const storage::v1::DrawnImages& drawn);

// In what two statements differ, shards apart, as the end of a sentence: "other forbidden regions".
// Empty: robot images of both belong together.
std::string DrawnDifference(const storage::v1::DrawnImages& a, const storage::v1::DrawnImages& b);

struct MergeSettings {
  std::string program;  // for the provenance log
  // Called with the number of finished tiles of all variants; false stops the merge.
  std::function<bool(uint64_t done, uint64_t tiles)> progress = nullptr;
};

struct MergeReport {
  uint64_t shards = 0;
  uint64_t tiles = 0;
  uint64_t records = 0;
  uint64_t bytes = 0;  // of records and index
};

// Unites all shards of one drawing in the new database `into`: their variants, records, collision
// index, and what else they all have (calibration, reference images, verification). Values are
// copied as they are, after their checksums were verified. Nothing is at `into` until all is; what
// an interrupted merge left beside it is replaced.
// AlreadyExists: there is something at `into`. FailedPrecondition, naming the shard: two differ in
// cell, digest or any of the above, one is there twice, one is missing, one lacks records or has
// some of other tiles, or its index is not whole. DataLoss: a value is damaged. Cancelled: stopped.
absl::StatusOr<MergeReport> MergeShards(const std::vector<std::string>& shards,
                                        const std::string& into, const MergeSettings& settings);

}  // namespace silhouette
