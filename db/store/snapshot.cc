// SPDX-License-Identifier: Apache-2.0
#include <utility>

#include "absl/strings/str_cat.h"
#include "db/status/status_macros.h"
#include "db/store/database_state.h"
#include "db/store/raw_image_format.h"
#include "db/store/raw_records.h"
#include "db/store/robot_image_format.h"
#include "db/store/schema.h"

namespace silhouette {
namespace {

// So that a transaction that is begun afterwards knows them.
absl::Status OpenSubDatabases(const DatabaseState& state) {
  RETURN_IF_ERROR(state.environment->Find(state.places.collision_index).status());
  return state.environment->Find(state.places.raw_images).status();
}

// Unavailable: others replaced the masks, and the settings in the cell's description with them.
absl::Status CheckSameCell(const DatabaseState& state, const ReadTransaction& transaction) {
  const auto hold = state.environment->HoldMap();
  ASSIGN_OR_RETURN(const auto cell,
                   ReadMeta(*state.environment, transaction.get(), schema::kCellKey));
  if (cell == state.stored_cell) return absl::OkStatus();
  return absl::UnavailableError(
      absl::StrCat("database '", state.path, "' changed meanwhile; load it again"));
}

}  // namespace

Snapshot::Snapshot(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Snapshot::~Snapshot() = default;
Snapshot::Snapshot(Snapshot&&) noexcept = default;
Snapshot& Snapshot::operator=(Snapshot&&) noexcept = default;

absl::StatusOr<Snapshot> Database::Read() const {
  RETURN_IF_ERROR(OpenSubDatabases(*state_));
  ASSIGN_OR_RETURN(ReadTransaction transaction, state_->environment->Read());
  return StateOf(std::make_shared<const ReadTransaction>(std::move(transaction)));
}

absl::StatusOr<Snapshot> Database::StateOf(std::shared_ptr<const ReadTransaction> held) const {
  Environment& environment = *state_->environment;
  const auto hold = environment.HoldMap();
  RETURN_IF_ERROR(CheckNames(environment, held->get()));
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
      if (absl::IsNotFound(variant.status())) break;
      RETURN_IF_ERROR(variant.status());
      RETURN_IF_ERROR(OpenSubDatabases(*(*variant)->state_));
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
    RETURN_IF_ERROR(CheckSameCell(*state_, *held));
    return states;
  }
  return absl::UnavailableError(
      absl::StrCat("the variants of database '", path(), "' change all the time; try again"));
}

uint64_t Snapshot::generation() const { return impl_->generation; }

uint64_t Snapshot::size() const { return impl_->size; }

absl::StatusOr<std::optional<RobotImage>> Snapshot::Find(ConfigurationNumber number) const {
  const auto hold = impl_->environment().HoldMap();
  ASSIGN_OR_RETURN(const auto value,
                   impl_->environment().Get(impl_->transaction(), impl_->state->robot_images,
                                            schema::EncodeKey(number)));
  if (!value) return std::optional<RobotImage>();
  ASSIGN_OR_RETURN(RobotImage image, DecodeRobotImage(number, *value, impl_->state->mask_sizes,
                                                      BaseOf(impl_->records(), number, *value)));
  return std::optional<RobotImage>(std::move(image));
}

absl::StatusOr<bool> Snapshot::Contains(ConfigurationNumber number) const {
  const auto hold = impl_->environment().HoldMap();
  ASSIGN_OR_RETURN(const auto value,
                   impl_->environment().Get(impl_->transaction(), impl_->state->robot_images,
                                            schema::EncodeKey(number)));
  return value.has_value();
}

absl::Status Snapshot::ForEach(
    const std::function<bool(ConfigurationNumber, absl::StatusOr<RobotImage>)>& visit) const {
  absl::Status damage;
  const absl::Status walked =
      ForEachRecord(impl_->records(), {}, [&](const RawRecord& record) -> absl::Status {
        const std::optional<ConfigurationNumber> number = schema::DecodeKey(record.key);
        if (!number || !impl_->state->grid.Contains(*number)) {
          damage = absl::DataLossError(absl::StrCat("database '", impl_->state->path,
                                                    "' has a robot image under a damaged key"));
        } else if (!visit(*number, DecodeRobotImage(*number, record.value, impl_->state->mask_sizes,
                                                    record.base))) {
          return absl::CancelledError("");
        }
        return absl::OkStatus();
      });
  return walked.ok() || absl::IsCancelled(walked) ? damage : walked;
}

absl::StatusOr<std::optional<storage::v1::References>> Snapshot::References() const {
  return impl_->Meta<storage::v1::References>(schema::kReferencesKey);
}

absl::StatusOr<std::optional<storage::v1::Calibration>> Snapshot::Calibration() const {
  auto calibration = impl_->Meta<storage::v1::Calibration>(schema::kCalibrationKey);
  if (absl::IsDataLoss(calibration.status()) ||
      (calibration.ok() && *calibration &&
       !CheckCalibration(**calibration, impl_->state->cell).ok())) {
    return absl::DataLossError(
        absl::StrCat("database '", impl_->state->path,
                     "': its calibration is damaged; import it again, or remove it"));
  }
  return calibration;
}

absl::StatusOr<std::optional<storage::v1::ModelVerification>> Snapshot::Verification() const {
  auto verification = impl_->Meta<storage::v1::ModelVerification>(schema::kVerificationKey);
  if (absl::IsDataLoss(verification.status())) {
    return absl::DataLossError(absl::StrCat("database '", impl_->state->path,
                                            "': its verification of the model is damaged; make it "
                                            "again with 'silhouette-capture verify-model'"));
  }
  return verification;
}

absl::StatusOr<storage::v1::CaptureHistory> Snapshot::CaptureHistory() const {
  ASSIGN_OR_RETURN(auto history,
                   impl_->Meta<storage::v1::CaptureHistory>(impl_->state->places.capture_key));
  return std::move(history).value_or(storage::v1::CaptureHistory());
}

absl::StatusOr<std::optional<storage::v1::DrawnImages>> Snapshot::DrawnImages() const {
  return impl_->Meta<storage::v1::DrawnImages>(impl_->state->places.drawn_key);
}

absl::StatusOr<storage::v1::ProvenanceLog> Snapshot::Provenance() const {
  const auto hold = impl_->environment().HoldMap();
  return ReadProvenance(impl_->environment(), impl_->transaction());
}

absl::StatusOr<std::optional<RawImage>> Snapshot::FindRawImage(ConfigurationNumber number,
                                                               int view) const {
  Environment& environment = impl_->environment();
  ASSIGN_OR_RETURN(const auto raw_images, environment.Find(impl_->state->places.raw_images));
  if (!raw_images) return std::optional<RawImage>();
  const auto hold = environment.HoldMap();
  const auto place = static_cast<uint64_t>(view);
  ASSIGN_OR_RETURN(const auto value, environment.Get(impl_->transaction(), *raw_images,
                                                     EncodeRawImageKey(number, place)));
  if (!value) return std::optional<RawImage>();
  ASSIGN_OR_RETURN(RawImage image, DecodeRawImage(number, place, *value));
  return std::optional<RawImage>(std::move(image));
}

absl::StatusOr<std::vector<ConfigurationNumber>> Snapshot::RawImageNumbers() const {
  Environment& environment = impl_->environment();
  std::vector<ConfigurationNumber> numbers;
  ASSIGN_OR_RETURN(const auto raw_images, environment.Find(impl_->state->places.raw_images));
  if (!raw_images) return numbers;
  const auto hold = environment.HoldMap();
  RETURN_IF_ERROR(environment.ForEachEntry(
      impl_->transaction(), *raw_images, "", [&](std::string_view key, std::string_view) {
        const auto number = NumberInRawImageKey(key);
        if (number && (numbers.empty() || numbers.back() != *number)) numbers.push_back(*number);
        return number.has_value();  // reference images come last
      }));
  return numbers;
}

absl::StatusOr<storage::v1::References> Snapshot::ReferencesOf(uint64_t id) const {
  Environment& environment = impl_->environment();
  ASSIGN_OR_RETURN(const auto raw_images, environment.Find(impl_->state->places.raw_images));
  const auto hold = environment.HoldMap();
  std::optional<std::string_view> value;
  if (raw_images) {
    ASSIGN_OR_RETURN(value,
                     environment.Get(impl_->transaction(), *raw_images, EncodeReferencesKey(id)));
  }
  if (!value) {
    return absl::NotFoundError(
        absl::StrCat("database '", impl_->state->path,
                     "' does not have the reference images that its raw images were taken with"));
  }
  const auto payload = schema::OpenMeta(*value);
  storage::v1::References references;
  if (!payload || IdOfReferences(*payload) != id ||
      !references.ParseFromArray(payload->data(), static_cast<int>(payload->size()))) {
    return absl::DataLossError(absl::StrCat("database '", impl_->state->path,
                                            "': reference images of raw images are damaged"));
  }
  return references;
}

}  // namespace silhouette
