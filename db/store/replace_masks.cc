// SPDX-License-Identifier: Apache-2.0
// Exchanging the masks of all variants for those of another database.
#include <optional>
#include <string>
#include <vector>

#include "absl/time/clock.h"
#include "db/status/status_macros.h"
#include "db/store/database_state.h"
#include "db/store/raw_records.h"
#include "db/store/robot_image_format.h"
#include "db/store/schema.h"

namespace silhouette {
namespace {

// The records of a variant, one after another.
class Records {
 public:
  explicit Records(const RecordSource& source) : source_(source) {}

  // Null: there are no more. Valid until the next call.
  absl::StatusOr<const RawRecord*> Next() {
    if (next_ == chunk_.size()) {
      ASSIGN_OR_RETURN(std::vector<RawRecord> chunk, ReadChunk(source_, keys_));
      chunk_ = std::move(chunk);
      next_ = 0;
      if (chunk_.empty()) return nullptr;
      keys_.after = chunk_.back().key;
    }
    return &chunk_[next_++];
  }

 private:
  const RecordSource source_;
  KeyRange keys_;
  std::vector<RawRecord> chunk_;
  size_t next_ = 0;
};

// Whether a record can be read and is excluded.
bool IsExcluded(const RawRecord& record, const std::vector<MaskSize>& mask_sizes) {
  const std::optional<ConfigurationNumber> number = schema::DecodeKey(record.key);
  if (!number) return false;
  const auto image = DecodeRobotImage(*number, record.value, mask_sizes, record.base);
  return image.ok() && image->excluded;
}

// InvalidArgument unless both have the same records, and the same of them are excluded.
absl::Status CheckSameRecords(const RecordSource& stored, const RecordSource& made,
                              const std::vector<MaskSize>& mask_sizes) {
  Records ours(stored);
  Records theirs(made);
  for (;;) {
    ASSIGN_OR_RETURN(const auto one, ours.Next());
    ASSIGN_OR_RETURN(const auto other, theirs.Next());
    if (one == nullptr && other == nullptr) return absl::OkStatus();
    if (one == nullptr || other == nullptr || one->key != other->key ||
        IsExcluded(*one, mask_sizes) != IsExcluded(*other, mask_sizes)) {
      return absl::InvalidArgumentError(
          "the new masks are not of just the configurations that have robot images");
    }
  }
}

// InvalidArgument unless the numbers and masks of one mean in the other what they mean in it.
absl::Status CheckSameShape(const Database& stored, const Database& made) {
  const auto edges = [](const Database& database) {
    const auto& of = database.cell().tile_edges();
    return std::vector<int>(of.begin(), of.end());
  };
  storage::v1::CellDescription wanted = stored.cell();
  wanted.set_segmentation(made.cell().segmentation());
  if (!Differences(wanted, "", made.cell(), "").empty() || edges(stored) != edges(made) ||
      stored.Variants() != made.Variants()) {
    return absl::InvalidArgumentError("the new masks are of another cell, or of other variants");
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status Database::ReplaceMasks(const Database& made, const std::string& program) {
  RETURN_IF_ERROR(CheckWritable(*state_));
  RETURN_IF_ERROR(CheckSameShape(*this, made));
  ASSIGN_OR_RETURN(const WriterTurn turn, WriterTurn::Take(*state_));
  ASSIGN_OR_RETURN(const auto stored_variants, ReadVariants());
  ASSIGN_OR_RETURN(const auto made_variants, made.ReadVariants());
  uint64_t records = 0;
  for (size_t i = 0; i < stored_variants.size(); ++i) {
    const Snapshot& stored = stored_variants[i].snapshot;
    RETURN_IF_ERROR(CheckSameRecords(
        stored.impl_->records(), made_variants[i].snapshot.impl_->records(), state_->mask_sizes));
    records += stored.size();
  }
  ASSIGN_OR_RETURN(const Usage usage, made.GetUsage());
  storage::v1::CellDescription description = cell();
  description.set_segmentation(made.cell().segmentation());
  std::string new_cell = description.SerializeAsString();
  const auto change = [&](WriteTransaction& transaction) -> absl::Status {
    for (size_t i = 0; i < made_variants.size(); ++i) {
      const MDB_dbi place = stored_variants[i].database->state_->robot_images;
      Records records_of_variant(made_variants[i].snapshot.impl_->records());
      for (;;) {
        ASSIGN_OR_RETURN(const auto record, records_of_variant.Next());
        if (record == nullptr) break;
        RETURN_IF_ERROR(transaction.Put(place, record->key, record->value));
      }
    }
    return WriteMeta(*state_->environment, transaction, schema::kCellKey, new_cell);
  };
  RETURN_IF_ERROR(
      WriteChange(*state_, usage.used_bytes, NewProvenance(absl::Now(), program, records), change));
  state_->cell = description;
  state_->stored_cell = std::move(new_cell);
  return absl::OkStatus();
}

}  // namespace silhouette
