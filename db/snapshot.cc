#include <utility>

#include "absl/strings/str_cat.h"
#include "db/database_state.h"
#include "db/robot_image_format.h"
#include "db/schema.h"

namespace silhouette {
namespace {

// How much ForEach copies out of the map at a time.
constexpr size_t kChunkBytes = size_t{1} << 20;

struct RawRecord {
  std::string key;
  std::string value;
};

}  // namespace

struct Snapshot::Impl {
  std::shared_ptr<const DatabaseState> state;
  ReadTransaction transaction;
  uint64_t generation = 0;
  uint64_t size = 0;

  Environment& environment() const { return *state->environment; }

  // Reads the value of a configuration's key: 0, MDB_NOTFOUND or an error. The caller holds the
  // map.
  int Get(ConfigurationNumber number, MDB_val& value) const {
    const schema::ConfigurationKey key = schema::EncodeKey(number);
    MDB_val key_val = ToVal({key.data(), key.size()});
    return mdb_get(transaction.get(), environment().robot_images(), &key_val, &value);
  }

  absl::StatusOr<std::vector<RawRecord>> ChunkAfter(const std::string& key) const;
};

// The records after `key` (empty: from the first), as many as make a chunk.
absl::StatusOr<std::vector<RawRecord>> Snapshot::Impl::ChunkAfter(const std::string& key) const {
  const auto hold = environment().HoldMap();
  MDB_cursor* cursor = nullptr;
  int code = mdb_cursor_open(transaction.get(), environment().robot_images(), &cursor);
  if (code != 0) return environment().ReadError(code);
  std::vector<RawRecord> chunk;
  size_t bytes = 0;
  MDB_val key_val = ToVal(key);
  MDB_val value;
  code = mdb_cursor_get(cursor, &key_val, &value, key.empty() ? MDB_FIRST : MDB_SET_RANGE);
  if (code == 0 && FromVal(key_val) == key) {
    code = mdb_cursor_get(cursor, &key_val, &value, MDB_NEXT);
  }
  while (code == 0 && bytes < kChunkBytes) {
    chunk.push_back({std::string(FromVal(key_val)), std::string(FromVal(value))});
    bytes += key_val.mv_size + value.mv_size;
    code = mdb_cursor_get(cursor, &key_val, &value, MDB_NEXT);
  }
  mdb_cursor_close(cursor);
  if (code != 0 && code != MDB_NOTFOUND) return environment().ReadError(code);
  return chunk;
}

Snapshot::Snapshot(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Snapshot::~Snapshot() = default;
Snapshot::Snapshot(Snapshot&&) noexcept = default;
Snapshot& Snapshot::operator=(Snapshot&&) noexcept = default;

absl::StatusOr<Snapshot> Database::Read() const {
  Environment& environment = *state_->environment;
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
  const int code = impl_->Get(number, value);
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
  const int code = impl_->Get(number, value);
  if (code != 0 && code != MDB_NOTFOUND) return impl_->environment().ReadError(code);
  return code == 0;
}

absl::Status Snapshot::ForEach(
    const std::function<bool(ConfigurationNumber, absl::StatusOr<RobotImage>)>& visit) const {
  absl::Status damage;
  std::string last;
  for (;;) {
    const absl::StatusOr<std::vector<RawRecord>> chunk = impl_->ChunkAfter(last);
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
    last = chunk->back().key;
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
