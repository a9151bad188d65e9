#include "server/scene/served_database.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "calib/calibration_message.h"
#include "db/robot_images_in_place.h"

namespace silhouette {
namespace {

void AddRecord(const MetRecord& record, RobotImageTable::Builder& builder) {
  switch (record.masks) {
    case StoredMasks::kPresent:
      return builder.Add(record.number, record.words);
    case StoredMasks::kExcluded:
      return builder.AddExcluded(record.number);
    case StoredMasks::kDamaged:
      return builder.AddCorrupt(record.number);
  }
}

bool FitMemory(const Database& database, uint64_t records, uint64_t memory) {
  uint64_t bytes = 0;
  for (const MaskSize size : database.mask_sizes()) bytes += size.words() * sizeof(uint64_t);
  return records <= memory / bytes;
}

// Adds the records that are met to `builder`, and tells how far it is.
VisitRecord AddingTo(RobotImageTable::Builder& builder, uint64_t records,
                     const LoadSettings& settings) {
  constexpr uint64_t kRecordsPerReport = 4096;
  return [&builder, records, &settings, done = uint64_t{0}](const MetRecord& record) mutable {
    AddRecord(record, builder);
    const bool tell = ++done % kRecordsPerReport == 0 || done == records;
    if (tell && settings.progress) settings.progress(done, records);
  };
}

absl::StatusOr<RobotImageTable> LoadIntoMemory(const Database& database, const Snapshot& snapshot,
                                               const LoadSettings& settings) {
  RobotImageTable::Builder builder(database.grid(), database.mask_sizes(), snapshot.size());
  const absl::Status status = ForEachMasks(snapshot, AddingTo(builder, snapshot.size(), settings));
  if (!status.ok()) return status;
  return std::move(builder).Build();
}

absl::StatusOr<RobotImageTable> LoadInPlace(const Database& database,
                                            const std::shared_ptr<const Snapshot>& snapshot,
                                            const LoadSettings& settings) {
  // The table is begun before there is what it will read from.
  const auto images = std::make_shared<std::shared_ptr<const RobotImagesInPlace>>();
  RobotImageTable::Builder builder(database.grid(), database.mask_sizes(),
                                   [images](ConfigurationNumber number, std::span<uint64_t> words) {
                                     return (*images)->Read(number, words);
                                   });
  auto opened = RobotImagesInPlace::Open(snapshot, AddingTo(builder, snapshot->size(), settings));
  if (!opened.ok()) return opened.status();
  *images = *std::move(opened);
  return std::move(builder).Build();
}

absl::StatusOr<RobotImageTable> LoadRobotImages(const Database& database,
                                                const std::shared_ptr<const Snapshot>& snapshot,
                                                const LoadSettings& settings) {
  return FitMemory(database, snapshot->size(), settings.robot_image_memory)
             ? LoadIntoMemory(database, *snapshot, settings)
             : LoadInPlace(database, snapshot, settings);
}

absl::StatusOr<std::vector<Reference>> LoadReferences(const Database& database,
                                                      const Snapshot& snapshot) {
  const absl::StatusOr<std::optional<storage::v1::References>> stored = snapshot.References();
  if (!stored.ok()) return stored.status();
  std::vector<Reference> references;
  if (!*stored) return references;
  if ((*stored)->views_size() != database.cell().views_size()) {
    return absl::DataLossError(absl::StrCat("'", database.path(),
                                            "' has not one reference image per view; take them "
                                            "anew"));
  }
  for (int view = 0; view < (*stored)->views_size(); ++view) {
    const storage::v1::Reference& png = (*stored)->views(view);
    absl::StatusOr<Reference> reference = Reference::FromPng(png.mean_png(), png.noise_png());
    if (!reference.ok()) {
      return absl::DataLossError(absl::StrCat("'", database.path(), "', view '",
                                              database.cell().views(view).name(),
                                              "': ", reference.status().message()));
    }
    references.push_back(*std::move(reference));
  }
  return references;
}

absl::StatusOr<std::optional<Calibration>> LoadCalibration(const Database& database,
                                                           const Snapshot& snapshot) {
  const absl::StatusOr<std::optional<storage::v1::Calibration>> stored = snapshot.Calibration();
  if (!stored.ok()) return stored.status();
  if (!*stored) return std::optional<Calibration>();
  absl::StatusOr<Calibration> calibration = CalibrationFrom(**stored);
  if (!calibration.ok()) {
    return absl::InvalidArgumentError(
        absl::StrCat("'", database.path(), "': its calibration: ", calibration.status().message()));
  }
  return std::optional<Calibration>(*std::move(calibration));
}

// The index, if it has a tile that can be used. Only then its snapshot is kept.
absl::StatusOr<std::shared_ptr<const CollisionIndex>> LoadIndex(
    std::shared_ptr<const Snapshot> snapshot) {
  absl::StatusOr<std::shared_ptr<const CollisionIndex>> index =
      CollisionIndex::Open(std::move(snapshot));
  if (!index.ok()) return index;
  const std::vector<uint64_t> tiles = (*index)->Tiles();
  const bool usable =
      std::ranges::any_of(tiles, [&](uint64_t tile) { return (*index)->Tile(tile) != nullptr; });
  return usable ? index : nullptr;
}

std::vector<std::string> NamesOfViews(const storage::v1::CellDescription& cell) {
  std::vector<std::string> names;
  for (const storage::v1::View& view : cell.views()) names.push_back(view.name());
  return names;
}

}  // namespace

ServedDatabase::ServedDatabase(storage::v1::CellDescription cell, uint64_t generation,
                               RobotImageTable robot_images,
                               std::shared_ptr<const CollisionIndex> index,
                               std::vector<Reference> references,
                               std::optional<Calibration> calibration,
                               std::optional<EpipolarBands> bands, ViewTreatments treatments,
                               std::shared_ptr<const SoundBasis> sound)
    : cell_(std::move(cell)),
      generation_(generation),
      robot_images_(std::move(robot_images)),
      index_(std::move(index)),
      references_(std::move(references)),
      calibration_(std::move(calibration)),
      bands_(std::move(bands)),
      treatments_(std::move(treatments)),
      sound_(std::move(sound)) {}

absl::StatusOr<std::shared_ptr<const ServedDatabase>> ServedDatabase::Load(
    const Database& database, const CalibrationSettings& settings,
    const TreatmentSettings& treatment_settings, const std::optional<SoundCell>& sound,
    const LoadSettings& load) {
  try {
    absl::StatusOr<Snapshot> read = database.Read();
    if (!read.ok()) return read.status();
    const auto snapshot = std::make_shared<const Snapshot>(*std::move(read));
    absl::StatusOr<RobotImageTable> robot_images = LoadRobotImages(database, snapshot, load);
    if (!robot_images.ok()) return robot_images.status();
    absl::StatusOr<std::vector<Reference>> references = LoadReferences(database, *snapshot);
    if (!references.ok()) return references.status();
    absl::StatusOr<std::optional<Calibration>> calibration = load.calibration;
    if (!load.calibration) calibration = LoadCalibration(database, *snapshot);
    if (!calibration.ok()) return calibration.status();
    std::optional<EpipolarBands> bands;
    if (*calibration) bands.emplace(**calibration, database.mask_sizes(), settings.margin);
    ViewTreatments treatments =
        TreatmentsOf(treatment_settings, *calibration ? &**calibration : nullptr,
                     NamesOfViews(database.cell()), database.mask_sizes());
    std::shared_ptr<const SoundBasis> sound_basis;
    if (sound && *calibration && !(*calibration)->cameras.empty()) {
      auto made =
          SoundBasis::Make(*sound, database.cell(), *robot_images, **calibration, settings.margin);
      if (!made.ok()) return made.status();
      sound_basis = *std::move(made);
    }
    auto index = LoadIndex(snapshot);
    if (!index.ok()) return index.status();
    std::shared_ptr<ServedDatabase> served(
        new ServedDatabase(database.cell(), snapshot->generation(), *std::move(robot_images),
                           *std::move(index), *std::move(references), *std::move(calibration),
                           std::move(bands), std::move(treatments), std::move(sound_basis)));
    const auto stored = snapshot->Calibration();
    if (stored.ok() && *stored) served->calibration_fingerprint_ = FingerprintOf(**stored);
    return served;
  } catch (const std::invalid_argument& error) {
    return absl::InvalidArgumentError(absl::StrCat("'", database.path(), "': ", error.what()));
  }
}

absl::Status ServedDatabase::CanServeSound(Preset preset) const {
  if (sound_ != nullptr) return absl::OkStatus();
  const std::string asked = absl::StrCat("the preset '", NameOf(preset), "' needs ");
  if (!calibration_ || calibration_->cameras.empty()) {
    return absl::FailedPreconditionError(absl::StrCat(
        asked, "a calibration with camera models, which the database does not have",
        calibration_ ? " (fundamental matrices do not tell where in space a pixel looks)" : "",
        "; import one with 'silhouette-db calibration import', or ask for the preset '",
        NameOf(BestPreset()), "'"));
  }
  return absl::FailedPreconditionError(
      absl::StrCat(asked,
                   "the section 'sound' in the cell file; state its least_obstacle there, or "
                   "ask for the preset '",
                   NameOf(BestPreset()), "'"));
}

absl::Status ServedDatabase::CanServe(const Policy& policy) const {
  if (IsSound(policy.preset)) return CanServeSound(policy.preset);
  if (!IsCalibrated(policy.preset) || bands_) return absl::OkStatus();
  return absl::FailedPreconditionError(absl::StrCat(
      "the preset '", NameOf(policy.preset),
      "' needs a calibration, which the database does not have; import one with 'silhouette-db "
      "calibration import', or ask for the preset 'uncalibrated'"));
}

Preset ServedDatabase::BestPreset() const {
  if (sound_ != nullptr) return Preset::kSound;
  return bands_ ? Preset::kCalibrated : Preset::kUncalibrated;
}

std::optional<int> ServedDatabase::ViewOf(const std::string& name) const {
  for (int view = 0; view < views(); ++view) {
    if (view_name(view) == name) return view;
  }
  return std::nullopt;
}

}  // namespace silhouette
