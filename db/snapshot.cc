#include <utility>

#include "absl/strings/str_cat.h"
#include "db/database_state.h"
#include "db/raw_records.h"
#include "db/robot_image_format.h"
#include "db/schema.h"
#include "db/snapshot_impl.h"

namespace silhouette {
namespace {

// Reads the value of a configuration's key: 0, MDB_NOTFOUND or an error. The caller holds the map.
int Get(const ReadTransaction& transaction, const Environment& environment,
        ConfigurationNumber number, MDB_val& value) {
  const schema::NumberKey key = schema::EncodeKey(number);
  MDB_val key_val = ToVal({key.data(), key.size()});
  return mdb_get(transaction.get(), environment.robot_images(), &key_val, &value);
}

}  // namespace

Snapshot::Snapshot(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Snapshot::~Snapshot() = default;
Snapshot::Snapshot(Snapshot&&) noexcept = default;
Snapshot& Snapshot::operator=(Snapshot&&) noexcept = default;

absl::StatusOr<Snapshot> Database::Read() const {
  Environment& environment = *state_->environment;
  // So that the transaction knows them.
  environment.Find(OptionalSubDatabase::kCollisionIndex);
  environment.Find(OptionalSubDatabase::kRawImages);
  absl::StatusOr<ReadTransaction> transaction = environment.Read();
  if (!transaction.ok()) return transaction.status();
  const auto hold = environment.HoldMap();
  const absl::StatusOr<uint64_t> generation = ReadGeneration(environment, transaction->get());
  if (!generation.ok()) return generation.status();
  MDB_stat images;
  const int code = mdb_stat(transaction->get(), environment.robot_images(), &images);
  if (code != 0) return environment.ReadError(code);
  return Snapshot(std::make_unique<Snapshot::Impl>(
      Snapshot::Impl{state_, std::move(*transaction), *generation, images.ms_entries}));
}

uint64_t Snapshot::generation() const { return impl_->generation; }

uint64_t Snapshot::size() const { return impl_->size; }

absl::StatusOr<std::optional<RobotImage>> Snapshot::Find(ConfigurationNumber number) const {
  const auto hold = impl_->environment().HoldMap();
  MDB_val value;
  const int code = Get(impl_->transaction, impl_->environment(), number, value);
  if (code == MDB_NOTFOUND) return std::optional<RobotImage>();
  if (code != 0) return impl_->environment().ReadError(code);
  absl::StatusOr<RobotImage> image =
      DecodeRobotImage(number, FromVal(value), impl_->state->mask_sizes);
  if (!image.ok()) return image.status();
  return std::optional<RobotImage>(*std::move(image));
}

absl::StatusOr<bool> Snapshot::Contains(ConfigurationNumber number) const {
  const auto hold = impl_->environment().HoldMap();
  MDB_val value;
  const int code = Get(impl_->transaction, impl_->environment(), number, value);
  if (code != 0 && code != MDB_NOTFOUND) return impl_->environment().ReadError(code);
  return code == 0;
}

absl::Status Snapshot::ForEach(
    const std::function<bool(ConfigurationNumber, absl::StatusOr<RobotImage>)>& visit) const {
  absl::Status damage;
  KeyRange keys;
  for (;;) {
    const absl::StatusOr<std::vector<RawRecord>> chunk =
        ReadChunk(impl_->environment(), impl_->transaction.get(), keys);
    if (!chunk.ok()) return chunk.status();
    if (chunk->empty()) return damage;
    for (const RawRecord& record : *chunk) {
      const std::optional<ConfigurationNumber> number = schema::DecodeKey(record.key);
      if (!number || !impl_->state->grid.Contains(*number)) {
        damage = absl::DataLossError(absl::StrCat("database '", impl_->state->path,
                                                  "' has a robot image under a damaged key"));
      } else if (!visit(*number,
                        DecodeRobotImage(*number, record.value, impl_->state->mask_sizes))) {
        return damage;
      }
    }
    keys.after = chunk->back().key;
  }
}

absl::StatusOr<std::optional<storage::v1::References>> Snapshot::References() const {
  const auto hold = impl_->environment().HoldMap();
  const auto payload =
      ReadMeta(impl_->environment(), impl_->transaction.get(), schema::kReferencesKey);
  if (!payload.ok()) return payload.status();
  std::optional<storage::v1::References> references;
  if (*payload && !references.emplace().ParseFromString(**payload)) {
    return absl::DataLossError(
        absl::StrCat("database '", impl_->state->path, "': its reference images are damaged"));
  }
  return references;
}

absl::StatusOr<std::optional<storage::v1::Calibration>> Snapshot::Calibration() const {
  const auto hold = impl_->environment().HoldMap();
  const auto payload =
      ReadMeta(impl_->environment(), impl_->transaction.get(), schema::kCalibrationKey);
  if (!payload.ok()) return payload.status();
  std::optional<storage::v1::Calibration> calibration;
  if (*payload && (!calibration.emplace().ParseFromString(**payload) ||
                   !CheckCalibration(*calibration, impl_->state->cell).ok())) {
    return absl::DataLossError(
        absl::StrCat("database '", impl_->state->path,
                     "': its calibration is damaged; import it anew, or remove it"));
  }
  return calibration;
}

absl::StatusOr<storage::v1::ProvenanceLog> Snapshot::Provenance() const {
  const auto hold = impl_->environment().HoldMap();
  return ReadProvenance(impl_->environment(), impl_->transaction.get());
}

}  // namespace silhouette
