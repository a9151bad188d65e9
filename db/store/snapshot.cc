#include <utility>

#include "absl/strings/str_cat.h"
#include "db/status/status_macros.h"
#include "db/store/database_state.h"
#include "db/store/raw_records.h"
#include "db/store/robot_image_format.h"
#include "db/store/schema.h"
#include "db/store/snapshot_impl.h"

namespace silhouette {
namespace {

// Reads the value of a configuration's key: 0, MDB_NOTFOUND or an error. The caller holds the map.
int Get(const RecordSource& source, ConfigurationNumber number, MDB_val& value) {
  const schema::NumberKey key = schema::EncodeKey(number);
  MDB_val key_val = ToVal({key.data(), key.size()});
  return mdb_get(source.transaction, source.records, &key_val, &value);
}

// So that a transaction that is begun afterwards knows them.
void OpenSubDatabases(const DatabaseState& state) {
  state.environment->Find(state.places.collision_index);
  state.environment->Find(state.places.raw_images);
}

}  // namespace

Snapshot::Snapshot(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Snapshot::~Snapshot() = default;
Snapshot::Snapshot(Snapshot&&) noexcept = default;
Snapshot& Snapshot::operator=(Snapshot&&) noexcept = default;

absl::StatusOr<Snapshot> Database::Read() const {
  OpenSubDatabases(*state_);
  ASSIGN_OR_RETURN(ReadTransaction transaction, state_->environment->Read());
  return StateOf(std::make_shared<const ReadTransaction>(std::move(transaction)));
}

absl::StatusOr<Snapshot> Database::StateOf(std::shared_ptr<const ReadTransaction> held) const {
  Environment& environment = *state_->environment;
  const auto hold = environment.HoldMap();
  ASSIGN_OR_RETURN(const uint64_t generation, ReadGeneration(environment, held->get()));
  MDB_stat images;
  const int code = mdb_stat(held->get(), state_->robot_images, &images);
  if (code != 0) return environment.ReadError(code);
  return Snapshot(std::make_unique<Snapshot::Impl>(
      Snapshot::Impl{state_, std::move(held), generation, images.ms_entries}));
}

absl::StatusOr<std::vector<VariantState>> Database::ReadVariants() const {
  constexpr int kAttempts = 100;
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    ASSIGN_OR_RETURN(const std::vector<std::string> names, Variants());
    std::vector<std::unique_ptr<Database>> variants;
    for (const std::string& name : names) {
      absl::StatusOr<std::unique_ptr<Database>> variant = OpenVariant(name);
      if (!variant.ok()) break;
      OpenSubDatabases(*(*variant)->state_);
      variants.push_back(*std::move(variant));
    }
    ASSIGN_OR_RETURN(ReadTransaction transaction, state_->environment->Read());
    const auto held = std::make_shared<const ReadTransaction>(std::move(transaction));
    {
      const auto hold = state_->environment->HoldMap();
      ASSIGN_OR_RETURN(const auto present,
                       silhouette::ReadVariants(*state_->environment, held->get()));
      if (present != names || variants.size() != names.size()) continue;  // changed meanwhile
    }
    std::vector<VariantState> states;
    for (std::unique_ptr<Database>& variant : variants) {
      ASSIGN_OR_RETURN(Snapshot snapshot, variant->StateOf(held));
      states.push_back({std::move(variant), std::move(snapshot)});
    }
    return states;
  }
  return absl::UnavailableError(
      absl::StrCat("the variants of database '", path(), "' change all the time; try again"));
}

uint64_t Snapshot::generation() const { return impl_->generation; }

uint64_t Snapshot::size() const { return impl_->size; }

absl::StatusOr<std::optional<RobotImage>> Snapshot::Find(ConfigurationNumber number) const {
  const auto hold = impl_->environment().HoldMap();
  MDB_val value;
  const int code = Get(impl_->records(), number, value);
  if (code == MDB_NOTFOUND) return std::optional<RobotImage>();
  if (code != 0) return impl_->environment().ReadError(code);
  ASSIGN_OR_RETURN(RobotImage image,
                   DecodeRobotImage(number, FromVal(value), impl_->state->mask_sizes,
                                    BaseOf(impl_->records(), number, FromVal(value))));
  return std::optional<RobotImage>(std::move(image));
}

absl::StatusOr<bool> Snapshot::Contains(ConfigurationNumber number) const {
  const auto hold = impl_->environment().HoldMap();
  MDB_val value;
  const int code = Get(impl_->records(), number, value);
  if (code != 0 && code != MDB_NOTFOUND) return impl_->environment().ReadError(code);
  return code == 0;
}

absl::Status Snapshot::ForEach(
    const std::function<bool(ConfigurationNumber, absl::StatusOr<RobotImage>)>& visit) const {
  absl::Status damage;
  KeyRange keys;
  for (;;) {
    ASSIGN_OR_RETURN(const std::vector<RawRecord> chunk, ReadChunk(impl_->records(), keys));
    if (chunk.empty()) return damage;
    for (const RawRecord& record : chunk) {
      const std::optional<ConfigurationNumber> number = schema::DecodeKey(record.key);
      if (!number || !impl_->state->grid.Contains(*number)) {
        damage = absl::DataLossError(absl::StrCat("database '", impl_->state->path,
                                                  "' has a robot image under a damaged key"));
      } else if (!visit(*number, DecodeRobotImage(*number, record.value, impl_->state->mask_sizes,
                                                  record.base))) {
        return damage;
      }
    }
    keys.after = chunk.back().key;
  }
}

absl::StatusOr<std::optional<storage::v1::References>> Snapshot::References() const {
  const auto hold = impl_->environment().HoldMap();
  ASSIGN_OR_RETURN(const auto payload,
                   ReadMeta(impl_->environment(), impl_->transaction(), schema::kReferencesKey));
  std::optional<storage::v1::References> references;
  if (payload && !references.emplace().ParseFromString(*payload)) {
    return absl::DataLossError(
        absl::StrCat("database '", impl_->state->path, "': its reference images are damaged"));
  }
  return references;
}

absl::StatusOr<std::optional<storage::v1::Calibration>> Snapshot::Calibration() const {
  const auto hold = impl_->environment().HoldMap();
  ASSIGN_OR_RETURN(const auto payload,
                   ReadMeta(impl_->environment(), impl_->transaction(), schema::kCalibrationKey));
  std::optional<storage::v1::Calibration> calibration;
  if (payload && (!calibration.emplace().ParseFromString(*payload) ||
                  !CheckCalibration(*calibration, impl_->state->cell).ok())) {
    return absl::DataLossError(
        absl::StrCat("database '", impl_->state->path,
                     "': its calibration is damaged; import it anew, or remove it"));
  }
  return calibration;
}

absl::StatusOr<storage::v1::ProvenanceLog> Snapshot::Provenance() const {
  const auto hold = impl_->environment().HoldMap();
  return ReadProvenance(impl_->environment(), impl_->transaction());
}

}  // namespace silhouette
