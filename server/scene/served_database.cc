// SPDX-License-Identifier: Apache-2.0
#include "server/scene/served_database.h"

#include <xxhash.h>

#include <algorithm>
#include <stdexcept>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "calib/files/calibration_message.h"
#include "calib/robot/drawn_digest.h"
#include "capture/verification/verified_robot.h"
#include "db/status/status_macros.h"
#include "db/store/robot_images_in_place.h"
#include "db/store/schema.h"
#include "db/store/shards.h"
#include "db/store/suspects.h"
#include "db/store/writer_lock.h"

namespace silhouette {
namespace {

// By what the robot images of a variant are judged.
struct CaptureOfVariant {
  FixedJointRanges& used;  // where fixed joints stood: of all variants, as far as they are used
  double tolerance = 0;
  std::string elsewhere;  // ServedDatabase::elsewhere()
  SuspectSpans suspects;
  absl::Time newest = absl::InfinitePast();  // when the latest was captured
};

void AddImage(const MetRecord& record, CaptureOfVariant& capture,
              RobotImageTable::Builder& builder) {
  capture.newest = std::max(capture.newest, record.captured);
  if (capture.suspects.Contain(record.captured)) {
    return builder.AddWithout(record.number, RobotImageState::kSuspect);
  }
  const std::optional<std::string> elsewhere =
      capture.used.Elsewhere(record.measured, capture.tolerance);
  if (!elsewhere) {
    capture.used.Add(record.measured);
    const bool shows_robot =
        std::ranges::any_of(record.words, [](uint64_t word) { return word != 0; });
    return shows_robot ? builder.Add(record.number, record.words)
                       : builder.AddWithout(record.number, RobotImageState::kEmpty);
  }
  if (capture.elsewhere.empty()) capture.elsewhere = *elsewhere;
  builder.AddWithout(record.number, RobotImageState::kElsewhere);
}

void AddRecord(const MetRecord& record, CaptureOfVariant& capture,
               RobotImageTable::Builder& builder) {
  switch (record.masks) {
    case StoredMasks::kPresent:
      return AddImage(record, capture, builder);
    case StoredMasks::kExcluded:
      return builder.AddWithout(record.number, RobotImageState::kExcluded);
    case StoredMasks::kDamaged:
      return builder.AddWithout(record.number, RobotImageState::kCorrupt);
  }
}

// Of the robot images of a configuration.
uint64_t BytesOfRecord(const Database& database) {
  uint64_t bytes = 0;
  for (const MaskSize size : database.mask_sizes()) bytes += size.words() * sizeof(uint64_t);
  return bytes;
}

// Adds the records that are met to `builder`, and reports progress.
VisitRecord AddingTo(RobotImageTable::Builder& builder, CaptureOfVariant& capture, uint64_t records,
                     const LoadSettings& settings) {
  constexpr uint64_t kRecordsPerReport = 4096;
  return [&builder, &capture, records, &settings,
          done = uint64_t{0}](const MetRecord& record) mutable {
    AddRecord(record, capture, builder);
    const bool tell = ++done % kRecordsPerReport == 0 || done == records;
    if (tell && settings.progress) settings.progress(done, records);
  };
}

absl::StatusOr<RobotImageTable> LoadIntoMemory(const Database& database, const Snapshot& snapshot,
                                               const LoadSettings& settings,
                                               CaptureOfVariant& capture) {
  RobotImageTable::Builder builder(database.grid(), database.mask_sizes(), snapshot.size(),
                                   settings.forbidden);
  RETURN_IF_ERROR(ForEachMasks(snapshot, AddingTo(builder, capture, snapshot.size(), settings)));
  return std::move(builder).Build();
}

absl::StatusOr<RobotImageTable> LoadInPlace(const Database& database,
                                            const std::shared_ptr<const Snapshot>& snapshot,
                                            const LoadSettings& settings,
                                            CaptureOfVariant& capture) {
  // The table is begun before there is what it will read from.
  const auto images = std::make_shared<std::shared_ptr<const RobotImagesInPlace>>();
  RobotImageTable::Builder builder(
      database.grid(), database.mask_sizes(),
      [images](ConfigurationNumber number, std::span<uint64_t> words) {
        return (*images)->Read(number, words);
      },
      settings.forbidden);
  ASSIGN_OR_RETURN(
      auto opened,
      RobotImagesInPlace::Open(snapshot, AddingTo(builder, capture, snapshot->size(), settings)));
  *images = std::move(opened);
  return std::move(builder).Build();
}

absl::StatusOr<RobotImageTable> LoadRobotImages(const Database& database,
                                                const std::shared_ptr<const Snapshot>& snapshot,
                                                LoadSettings& settings, CaptureOfVariant& capture) {
  const uint64_t bytes = BytesOfRecord(database);
  const bool further = database.variant() != schema::kDefaultVariant;
  if ((further && !settings.variants_in_memory) ||
      snapshot->size() > settings.robot_image_memory / bytes) {
    return LoadInPlace(database, snapshot, settings, capture);
  }
  settings.robot_image_memory -= snapshot->size() * bytes;
  return LoadIntoMemory(database, *snapshot, settings, capture);
}

absl::Status CheckMotionShown(const Database& database, const RobotImageTable& images) {
  const uint64_t shown = images.Count(RobotImageState::kPresent);
  // Of robot images that are all empty none is present.
  const uint64_t captured = shown > 0 ? shown : images.Count(RobotImageState::kEmpty);
  for (int view = 0; view < images.views(); ++view) {
    const std::string fault = WhyNoMotionShows(
        database.cell().views(view).name(), images.covered(view), images.permanent(view), captured);
    if (!fault.empty()) {
      return absl::FailedPreconditionError(absl::StrCat("'", database.path(), "': ", fault));
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<std::vector<Reference>> LoadReferences(const Database& database,
                                                      const Snapshot& snapshot) {
  ASSIGN_OR_RETURN(const std::optional<storage::v1::References> stored, snapshot.References());
  std::vector<Reference> references;
  if (!stored) return references;
  if (stored->views_size() != database.cell().views_size()) {
    return absl::DataLossError(absl::StrCat("'", database.path(),
                                            "' has not one reference image per view; take them "
                                            "again"));
  }
  for (int view = 0; view < stored->views_size(); ++view) {
    const storage::v1::Reference& png = stored->views(view);
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
  ASSIGN_OR_RETURN(const std::optional<storage::v1::Calibration> stored, snapshot.Calibration());
  if (!stored) return std::optional<Calibration>();
  absl::StatusOr<Calibration> calibration = CalibrationFrom(*stored);
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

// The robot to draw of a database whose only variant is the default one.
absl::StatusOr<VerifiedRobot> RobotToDraw(const Database& database, const Snapshot& snapshot,
                                          const DrawnCell& cell,
                                          const std::optional<Calibration>& calibration,
                                          double margin) {
  ASSIGN_OR_RETURN(DrawnRobot bare, BareRobotOf(cell, database, calibration, margin));
  ASSIGN_OR_RETURN(const auto verification, snapshot.Verification());
  return VerifiedRobotOf(cell, std::move(bare), database.grid().joints(), verification);
}

// A model cannot hold all of a robot of which captured images show more. `growth`: as
// VerifiedRobot has it.
absl::Status CheckWholeModel(const SoundCell& sound, const RobotModel& model,
                             std::span<const double> growth) {
  if (!sound.settings.whole_model || growth.empty()) return absl::OkStatus();
  const auto most = std::ranges::max_element(growth);
  if (*most <= sound.settings.model_tolerance) return absl::OkStatus();
  const auto link = static_cast<size_t>(most - growth.begin());
  return FailedPrecondition(
      "sound: the cell file states 'whole_model: true', but 'silhouette-capture verify-model' "
      "found "
      "that the link '",
      model.links()[link].name, "' reaches ", absl::StrFormat("%.1f", 100 * *most),
      " cm beyond the model, more than model_tolerance; state 'whole_model: false', or correct the "
      "model and verify it again");
}

// The index of drawn images, if they are those of the robot that the server draws. Otherwise null,
// and `unused` says why if there are any.
absl::StatusOr<std::shared_ptr<const CollisionIndex>> LoadDrawnIndex(
    std::shared_ptr<const Snapshot> snapshot, const DrawnCell& cell, const DrawnRobot& robot,
    std::string& unused) {
  ASSIGN_OR_RETURN(const auto stored, snapshot->DrawnImages());
  if (!stored) return nullptr;
  storage::v1::DrawnImages own;
  own.set_digest(DigestOf(robot));
  own.set_forbidden(cell.forbidden_text);
  own.set_tolerance(cell.parts.tolerance);
  const std::string difference = DrawnDifference(*stored, own);
  if (difference.empty()) return LoadIndex(std::move(snapshot));
  unused = absl::StrCat("the stored robot images were drawn from ", difference,
                        ": maps are drawn instead; draw the images again with 'silhouette-capture "
                        "draw'");
  return nullptr;
}

// What kind of images of nodes a variant has; nothing for any other variant.
std::optional<DrawnKind> NodeKindOf(const Database& variant) {
  for (const DrawnKind kind : KindsFor(variant.grid())) {
    if (kind != DrawnKind::kWhole && variant.variant() == NameOf(kind)) return kind;
  }
  return std::nullopt;
}

// Drawn images are not what cameras saw: without the model's verification they decide nothing.
absl::Status CheckCaptured(const Database& database, const Snapshot& snapshot) {
  ASSIGN_OR_RETURN(const auto drawn, snapshot.DrawnImages());
  if (!drawn) return absl::OkStatus();
  return FailedPrecondition("'", database.path(),
                            "': its robot images were drawn, and the cell file says that they are "
                            "captured; state 'images: drawn' of the robot in the cell file");
}

uint64_t CellDigest(storage::v1::CellDescription cell) {
  cell.clear_segmentation();
  const std::string bytes = cell.SerializeAsString();
  return std::max<uint64_t>(XXH3_64bits(bytes.data(), bytes.size()), 1);
}

std::vector<std::string> NamesOfViews(const storage::v1::CellDescription& cell) {
  std::vector<std::string> names;
  for (const storage::v1::View& view : cell.views()) names.push_back(view.name());
  return names;
}

}  // namespace

ServedDatabase::ServedDatabase(std::string variant, const Common& common,
                               RobotImageTable robot_images, std::string elsewhere,
                               std::shared_ptr<const CollisionIndex> index,
                               std::shared_ptr<const SoundBasis> sound)
    : variant_(std::move(variant)),
      cell_(common.cell),
      generation_(common.generation),
      cell_digest_(CellDigest(common.cell)),
      robot_images_(std::move(robot_images)),
      damage_(common.damage),
      fixed_joints_(common.fixed_joints),
      elsewhere_(std::move(elsewhere)),
      index_(std::move(index)),
      references_(common.references),
      outlines_(common.outlines),
      calibration_(common.calibration),
      calibration_fingerprint_(common.calibration_fingerprint),
      calibration_doubt_(common.calibration_doubt),
      calibration_margin_(common.calibration_margin),
      bands_(common.bands),
      treatments_(common.treatments),
      sound_(std::move(sound)) {}

absl::StatusOr<ServedDatabase::Common> ServedDatabase::LoadCommon(
    const Database& database, const Snapshot& snapshot, const CalibrationSettings& settings,
    const TreatmentSettings& treatments, const LoadSettings& load) {
  Common common;
  common.cell = database.cell();
  common.generation = snapshot.generation();
  common.fixed_joints = std::make_shared<FixedJointRanges>(common.cell);
  ASSIGN_OR_RETURN(std::vector<Reference> references, LoadReferences(database, snapshot));
  common.references = std::move(references);
  for (const Reference& reference : common.references) common.outlines.emplace_back(reference);
  absl::StatusOr<std::optional<Calibration>> calibration = load.calibration;
  if (!load.calibration) calibration = LoadCalibration(database, snapshot);
  if (!calibration.ok()) return calibration.status();
  common.calibration = *std::move(calibration);
  const Calibration* known = common.calibration ? &*common.calibration : nullptr;
  if (known != nullptr) {
    common.bands =
        std::make_shared<const EpipolarBands>(*known, database.mask_sizes(), settings.margin);
  }
  common.treatments =
      TreatmentsOf(treatments, known, NamesOfViews(database.cell()), database.mask_sizes());
  common.calibration_margin = settings.margin;
  common.calibration_doubt = load.calibration_doubt;
  const auto stored = snapshot.Calibration();
  if (stored.ok() && *stored) common.calibration_fingerprint = FingerprintOf(**stored);
  return common;
}

absl::StatusOr<std::shared_ptr<ServedDatabase>> ServedDatabase::LoadVariant(
    const Database& database, std::shared_ptr<const Snapshot> snapshot, const Common& common,
    const CalibrationSettings& settings, const std::optional<SoundCell>& sound,
    LoadSettings& load) {
  ASSIGN_OR_RETURN(const storage::v1::CaptureHistory history, snapshot->CaptureHistory());
  CaptureOfVariant capture{*common.fixed_joints, load.fixed_joint_tolerance, "",
                           SuspectSpans(history)};
  absl::StatusOr<RobotImageTable> loaded;
  std::string unverified;
  if (load.drawn) {
    ASSIGN_OR_RETURN(VerifiedRobot robot, RobotToDraw(database, *snapshot, *load.drawn,
                                                      common.calibration, settings.margin));
    unverified = std::move(robot.unverified);
    if (sound) RETURN_IF_ERROR(CheckWholeModel(*sound, *load.drawn->robot, robot.growth));
    loaded = RobotImageTable::Drawn(database.grid(),
                                    std::make_shared<const DrawnRobot>(std::move(robot.robot)),
                                    load.drawn->forbidden);
  } else {
    loaded = LoadRobotImages(database, snapshot, load, capture);
  }
  ASSIGN_OR_RETURN(RobotImageTable robot_images, std::move(loaded));
  std::shared_ptr<const SoundBasis> sound_basis;
  std::shared_ptr<const SeparationBasis> separation;
  if (sound && common.calibration && !common.calibration->cameras.empty()) {
    ASSIGN_OR_RETURN(auto made,
                     SoundBasis::Make(*sound, database.cell(), robot_images, *common.calibration,
                                      settings.margin, common.treatments.views));
    sound_basis = std::move(made);
  }
  if (sound_basis != nullptr && sound->separation) {
    ASSIGN_OR_RETURN(
        separation,
        SeparationBasis::Make(*sound, sound_basis, database.cell(), robot_images,
                              *common.calibration, settings.margin, load.fixed_joint_tolerance));
  }
  std::shared_ptr<const CollisionIndex> index;
  std::string index_unused;
  if (load.drawn && !robot_images.has_nodes()) {
    ASSIGN_OR_RETURN(index, LoadDrawnIndex(std::move(snapshot), *load.drawn, *robot_images.drawn(),
                                           index_unused));
  } else if (!load.drawn) {
    RETURN_IF_ERROR(CheckMotionShown(database, robot_images));
    RETURN_IF_ERROR(CheckCaptured(database, *snapshot));
    ASSIGN_OR_RETURN(index, LoadIndex(std::move(snapshot)));
  }
  std::shared_ptr<ServedDatabase> served(
      new ServedDatabase(database.variant(), common, std::move(robot_images),
                         std::move(capture.elsewhere), std::move(index), std::move(sound_basis)));
  served->unverified_ = std::move(unverified);
  served->suspects_ = capture.suspects.Until(capture.newest);
  served->newest_ = capture.newest;
  served->index_unused_ = std::move(index_unused);
  served->separation_ = std::move(separation);
  return served;
}

absl::Status ServedDatabase::LoadNodeIndex(DrawnKind kind, Snapshot snapshot,
                                           const DrawnCell& cell) {
  ASSIGN_OR_RETURN(auto index,
                   LoadDrawnIndex(std::make_shared<const Snapshot>(std::move(snapshot)), cell,
                                  *robot_images_.node_robot(kind), index_unused_));
  (kind == DrawnKind::kOwn ? own_index_ : reach_index_) = std::move(index);
  return absl::OkStatus();
}

absl::StatusOr<std::shared_ptr<const ServedDatabase>> ServedDatabase::Load(
    const Database& database, const CalibrationSettings& settings,
    const TreatmentSettings& treatments, const std::optional<SoundCell>& sound,
    const LoadSettings& load) {
  try {
    ASSIGN_OR_RETURN(std::vector<VariantState> variants, database.ReadVariants());
    const auto other = std::ranges::find_if(
        variants.begin() + 1, variants.end(),
        [](const VariantState& variant) { return !NodeKindOf(*variant.database); });
    if (load.drawn && other != variants.end()) {
      return absl::FailedPreconditionError(absl::StrCat(
          "'", database.path(),
          "': a robot whose images are drawn is as its model has it, and the "
          "database has the variant '",
          other->database->variant(),
          "' as well; make a database for each tool, with a model of its own, or state 'images: "
          "captured' of the robot in the cell file"));
    }
    ASSIGN_OR_RETURN(const Common common,
                     LoadCommon(database, variants.front().snapshot, settings, treatments, load));
    LoadSettings left = load;
    std::shared_ptr<ServedDatabase> whole;
    for (VariantState& variant : variants) {
      const std::optional<DrawnKind> nodes = NodeKindOf(*variant.database);
      if (load.drawn && nodes) {
        RETURN_IF_ERROR(whole->LoadNodeIndex(*nodes, std::move(variant.snapshot), *load.drawn));
        continue;
      }
      ASSIGN_OR_RETURN(auto served,
                       LoadVariant(*variant.database,
                                   std::make_shared<const Snapshot>(std::move(variant.snapshot)),
                                   common, settings, sound, left));
      if (!load.drawn && !ReadersKeepWritersOut(database.path())) {
        served->file_ = std::move(variant.database);
      }
      if (whole == nullptr) {
        whole = std::move(served);
      } else {
        whole->other_variants_.emplace(served->variant(), std::move(served));
      }
    }
    return whole;
  } catch (const std::invalid_argument& error) {
    return absl::InvalidArgumentError(absl::StrCat("'", database.path(), "': ", error.what()));
  }
}

absl::StatusOr<bool> ServedDatabase::SuspectsChanged() const {
  if (file_ != nullptr) {
    ASSIGN_OR_RETURN(const Snapshot snapshot, file_->Read());
    ASSIGN_OR_RETURN(const storage::v1::CaptureHistory history, snapshot.CaptureHistory());
    if (SuspectSpans(history).Until(newest_) != suspects_) return true;
  }
  for (const auto& [name, variant] : other_variants_) {
    ASSIGN_OR_RETURN(const bool changed, variant->SuspectsChanged());
    if (changed) return true;
  }
  return false;
}

std::vector<std::string> ServedDatabase::variants() const {
  std::vector<std::string> names = {variant_};
  for (const auto& [name, variant] : other_variants_) names.push_back(name);
  return names;
}

std::shared_ptr<const ServedDatabase> ServedDatabase::VariantOf(
    const std::shared_ptr<const ServedDatabase>& whole, const std::string& name) {
  if (name.empty() || name == whole->variant_) return whole;
  const auto found = whole->other_variants_.find(name);
  return found == whole->other_variants_.end() ? nullptr : found->second;
}

const ServedDatabase* ServedDatabase::Variant(const std::string& name) const {
  if (name.empty() || name == variant_) return this;
  const auto found = other_variants_.find(name);
  return found == other_variants_.end() ? nullptr : found->second.get();
}

absl::Status ServedDatabase::CanServeSound(Preset preset) const {
  if (sound_ != nullptr) return absl::OkStatus();
  const std::string asked = absl::StrCat("the preset '", NameOf(preset), "' needs ");
  if (!calibration_ || calibration_->cameras.empty()) {
    return absl::FailedPreconditionError(absl::StrCat(
        asked, "a calibration with camera models, which the database does not have",
        calibration_ ? " (fundamental matrices do not say where in space a pixel looks)" : "",
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
  return sound_ != nullptr ? Preset::kSound : Preset::kUncalibrated;
}

std::optional<int> ServedDatabase::ViewOf(const std::string& name) const {
  for (int view = 0; view < views(); ++view) {
    if (view_name(view) == name) return view;
  }
  return std::nullopt;
}

}  // namespace silhouette
