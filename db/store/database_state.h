// SPDX-License-Identifier: Apache-2.0
// What a Database and the snapshots and writers made from it share, and access to `meta`.
#pragma once

#include <atomic>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "db/status/status_macros.h"
#include "db/store/environment.h"
#include "db/store/schema.h"
#include "db/store/store.h"
#include "db/store/writer_lock.h"

namespace silhouette {

struct DatabaseState {
  DatabaseState(std::string folder, storage::v1::CellDescription description,
                ConfigurationGrid configurations, std::vector<MaskSize> sizes)
      : path(std::move(folder)),
        cell(std::move(description)),
        grid(std::move(configurations)),
        mask_sizes(std::move(sizes)) {}
  // The same database with the robot images of another variant, which lie in `images`.
  DatabaseState(const DatabaseState& other, schema::VariantPlaces variant, MDB_dbi images)
      : path(other.path),
        cell(other.cell),
        stored_cell(other.stored_cell),
        grid(other.grid),
        mask_sizes(other.mask_sizes),
        writer_lock(other.writer_lock),
        environment(other.environment),
        has_writer(other.has_writer),
        places(std::move(variant)),
        robot_images(images) {}

  const std::string path;
  storage::v1::CellDescription cell;
  std::string stored_cell;  // the same, as `meta` has it
  const ConfigurationGrid grid;
  const std::vector<MaskSize> mask_sizes;
  // After the lock, so that the environment is closed first.
  std::shared_ptr<const WriterLock> writer_lock;  // null: open for reading only
  std::shared_ptr<Environment> environment;
  // Of all variants: one at a time.
  std::shared_ptr<std::atomic<bool>> has_writer = std::make_shared<std::atomic<bool>>(false);
  // Of the variant.
  schema::VariantPlaces places = schema::PlacesOfVariant(schema::kDefaultVariant);
  MDB_dbi robot_images = 0;
};

// FailedPrecondition: the database is open for reading only.
absl::Status CheckWritable(const DatabaseState& state);

// The turn of the one writer that the variants of a database may have at a time; given back at the
// end.
class WriterTurn {
 public:
  // FailedPrecondition: the database is open for reading only, or another has the turn.
  static absl::StatusOr<WriterTurn> Take(const DatabaseState& state);
  WriterTurn(WriterTurn&&) noexcept = default;
  WriterTurn& operator=(WriterTurn&&) = delete;
  ~WriterTurn() {
    if (taken_) *taken_ = false;
  }

 private:
  explicit WriterTurn(std::shared_ptr<std::atomic<bool>> taken) : taken_(std::move(taken)) {}
  std::shared_ptr<std::atomic<bool>> taken_;
};

// The names of the variants, the default one first. The caller holds the map.
absl::StatusOr<std::vector<std::string>> ReadVariants(const Environment& environment,
                                                      MDB_txn* transaction);

// The robot images of the other variants that there are.
absl::StatusOr<std::vector<MDB_dbi>> OtherVariants(Environment& environment);

// Whether a record fits the cell; InvalidArgument as RobotImageWriter::Put says.
absl::Status CheckFits(const DatabaseState& state, const RobotImage& image);

// Whether no key of `meta` and no sub-database with entries has a name but those of the schema: the
// bearer of a damaged name would be taken for absent. DataLoss: one has. The caller holds the map.
absl::Status CheckNames(const Environment& environment, MDB_txn* transaction);

// The payload of `key` in `meta`; nothing if there is none. DataLoss if its checksum does not hold.
// The caller holds the map.
absl::StatusOr<std::optional<std::string>> ReadMeta(const Environment& environment,
                                                    MDB_txn* transaction, std::string_view key);

// DataLoss: the entry `key` is damaged.
absl::Status DamagedMeta(const Environment& environment, std::string_view key);

// The same, parsed.
template <typename Message>
absl::StatusOr<std::optional<Message>> ReadMetaMessage(const Environment& environment,
                                                       MDB_txn* transaction, std::string_view key) {
  ASSIGN_OR_RETURN(const auto payload, ReadMeta(environment, transaction, key));
  std::optional<Message> message;
  if (payload && !message.emplace().ParseFromString(*payload)) return DamagedMeta(environment, key);
  return message;
}

absl::Status WriteMeta(const Environment& environment, WriteTransaction& transaction,
                       std::string_view key, std::string_view payload);

// The generation. DataLoss if there is none.
absl::StatusOr<uint64_t> ReadGeneration(const Environment& environment, MDB_txn* transaction);

// To be part of every change.
absl::Status RaiseGeneration(const Environment& environment, WriteTransaction& transaction);

absl::StatusOr<storage::v1::ProvenanceLog> ReadProvenance(const Environment& environment,
                                                          MDB_txn* transaction);

storage::v1::Provenance NewProvenance(absl::Time time, const std::string& program,
                                      uint64_t robot_images);

// Runs `write` as one change (Environment::Update), which raises the generation. `entry` goes into
// the provenance log unless it names no program.
absl::Status WriteChange(const DatabaseState& state, size_t new_bytes,
                         const storage::v1::Provenance& entry, const Environment::Change& write);

}  // namespace silhouette
