#include "calib/program/check_views.h"

#include <filesystem>
#include <opencv2/imgcodecs.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/time/clock.h"
#include "calib/calibration_message.h"
#include "calib/program/silhouette_drift.h"
#include "calib/tags/sighting_file.h"
#include "db/store.h"
#include "tools/cell/cell.h"
#include "tools/picture/files.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;

using Sightings = std::map<SeenTag, TagSighting>;

absl::StatusOr<Sightings> ReadMeans(const std::string& file) {
  const absl::StatusOr<std::string> text = ReadWholeFile(file);
  if (!text.ok()) return text.status();
  const absl::StatusOr<std::vector<TagSighting>> sightings = SightingsFromText(*text, file);
  if (!sightings.ok()) return sightings.status();
  absl::StatusOr<Sightings> means = MeanSightings(*sightings);
  if (means.ok()) return means;
  return absl::Status(means.status().code(), absl::StrCat(file, ": ", means.status().message()));
}

// As the calibration's record has them.
Sightings FixedTagsOf(const storage::v1::CalibrationRecord& record,
                      const storage::v1::CellDescription& cell) {
  Sightings sightings;
  for (const storage::v1::FixedTag& tag : record.fixed_tags()) {
    TagSighting sighting{.frame = "",
                         .view = cell.views(tag.view()).name(),
                         .family = tag.family(),
                         .tag = tag.tag(),
                         .sigma = tag.sigma()};
    for (int i = 0; i < 4; ++i) {
      sighting.corners[static_cast<size_t>(i)] = {tag.corners(2 * i), tag.corners(2 * i + 1)};
    }
    sightings.emplace(SeenTag{sighting.view, sighting.family, sighting.tag}, sighting);
  }
  return sightings;
}

CheckedView Summary(const ViewDrift& drift, double limit) {
  return {.name = drift.view,
          .method = drift.method,
          .checked = drift.checked,
          .moved_px = drift.moved,
          .moved_mask_px = drift.moved_mask,
          .holds = drift.checked && drift.moved_mask <= limit,
          .message = drift.message};
}

absl::StatusOr<Sightings> TagsOfThen(const CheckRequest& request,
                                     const storage::v1::Calibration& stored,
                                     const storage::v1::CellDescription& cell) {
  if (!request.reference.empty()) return ReadMeans(request.reference);
  Sightings before = FixedTagsOf(stored.record(), cell);
  if (!before.empty()) return before;
  return absl::FailedPreconditionError(
      "the stored calibration does not say how the cameras saw tags that stay in the cell; give "
      "--reference, their corners from the day of the calibration, or import a calibration.yaml "
      "with fixed_tags");
}

absl::StatusOr<std::vector<ViewDrift>> ByTags(const CheckRequest& request,
                                              const storage::v1::Calibration& stored,
                                              const storage::v1::CellDescription& cell,
                                              const std::vector<ViewSizes>& sizes) {
  const absl::StatusOr<Sightings> before = TagsOfThen(request, stored, cell);
  if (!before.ok()) return before.status();
  const absl::StatusOr<Sightings> after = ReadMeans(request.corners);
  if (!after.ok()) return after.status();
  std::vector<ViewDrift> drifts;
  for (int i = 0; i < cell.views_size(); ++i) {
    drifts.push_back(
        DriftByTags(cell.views(i).name(), sizes[static_cast<size_t>(i)], *before, *after));
  }
  return drifts;
}

// The cell file's segmentation, if it is that of the database.
absl::StatusOr<SegmentationSettings> SegmentationFor(const CheckRequest& request,
                                                     const storage::v1::CellDescription& cell) {
  const absl::StatusOr<Cell> file = LoadCell(request.cell);
  if (!file.ok()) return file.status();
  const std::vector<std::string> differences =
      Differences(DescriptionOf(*file), "the cell file", cell, "the database");
  if (differences.empty()) return file->segmentation;
  return absl::FailedPreconditionError(absl::StrCat("the database '", request.database,
                                                    "' does not fit the cell file '", request.cell,
                                                    "': ", absl::StrJoin(differences, "; ")));
}

absl::StatusOr<std::vector<ViewDrift>> BySilhouettes(const CheckRequest& request,
                                                     const Snapshot& snapshot,
                                                     const storage::v1::CellDescription& cell,
                                                     const std::vector<ViewSizes>& sizes) {
  if (!request.number || request.cell.empty()) {
    return absl::InvalidArgumentError(
        "--images needs --number, the configuration in which the robot is parked, and --cell");
  }
  const absl::StatusOr<SegmentationSettings> segmentation = SegmentationFor(request, cell);
  if (!segmentation.ok()) return segmentation.status();
  const auto robot = snapshot.Find(*request.number);
  if (!robot.ok()) return robot.status();
  if (!*robot || (*robot)->excluded) {
    return absl::NotFoundError(
        absl::StrCat("configuration ", *request.number, " has no robot images"));
  }
  const auto references = snapshot.References();
  if (!references.ok()) return references.status();
  if (!*references) {
    return absl::FailedPreconditionError("the database has no reference images to difference with");
  }
  std::vector<ViewDrift> drifts;
  for (int i = 0; i < cell.views_size(); ++i) {
    const std::string& name = cell.views(i).name();
    const std::string file = (fs::path(request.images) / (name + ".png")).string();
    const cv::Mat image = cv::imread(file, cv::IMREAD_COLOR);
    if (image.empty()) return absl::NotFoundError(absl::StrCat("'", file, "' is no image"));
    const storage::v1::Reference& png = (*references)->views(i);
    const absl::StatusOr<Reference> reference = Reference::FromPng(png.mean_png(), png.noise_png());
    if (!reference.ok()) return reference.status();
    if (image.size() != reference->size()) {
      return absl::InvalidArgumentError(
          absl::StrCat("'", file, "' is not of the size of the reference image of '", name, "'"));
    }
    drifts.push_back(DriftBySilhouette(name, sizes[static_cast<size_t>(i)], image, *reference,
                                       *segmentation, (*robot)->masks[static_cast<size_t>(i)]));
  }
  return drifts;
}

// Of two ways to look at one view.
ViewDrift Worse(const ViewDrift& one, const ViewDrift& other) {
  if (!one.checked || !other.checked) return one.checked ? other : one;
  return one.moved_mask >= other.moved_mask ? one : other;
}

absl::StatusOr<std::vector<ViewSizes>> SizesOf(const storage::v1::CellDescription& cell) {
  std::vector<ViewSizes> sizes;
  for (const storage::v1::View& view : cell.views()) {
    if (view.image_width() <= 0) {
      return absl::FailedPreconditionError(
          absl::StrCat("the database does not say how large the images of view '", view.name(),
                       "' are; state image_size in the cell file and capture with it"));
    }
    sizes.push_back({.image = {view.image_width(), view.image_height()},
                     .mask = {view.mask_width(), view.mask_height()}});
  }
  return sizes;
}

}  // namespace

absl::StatusOr<Checked> CheckViews(const CheckRequest& request) {
  if (request.corners.empty() && request.images.empty()) {
    return absl::InvalidArgumentError(
        "give --corners, tags as they are seen now, or --images of the parked robot");
  }
  const auto database = Database::Open(request.database, Database::Access::kRead);
  if (!database.ok()) return database.status();
  const absl::StatusOr<Snapshot> snapshot = (*database)->Read();
  if (!snapshot.ok()) return snapshot.status();
  const auto stored = snapshot->Calibration();
  if (!stored.ok()) return stored.status();
  if (!*stored) {
    return absl::FailedPreconditionError(
        absl::StrCat("'", request.database,
                     "' has no calibration to check; import one with 'silhouette-db calibration "
                     "import'"));
  }
  const storage::v1::CellDescription& cell = (*database)->cell();
  absl::StatusOr<std::vector<ViewSizes>> sizes = SizesOf(cell);
  if (!sizes.ok()) return sizes.status();
  Checked checked;
  checked.sizes = *std::move(sizes);
  checked.check.time = absl::Now();
  checked.check.calibration = FingerprintOf(**stored);
  checked.check.limit_mask_px = request.limit;
  if (!request.corners.empty()) {
    auto drifts = ByTags(request, **stored, cell, checked.sizes);
    if (!drifts.ok()) return drifts.status();
    checked.drifts = *std::move(drifts);
  }
  if (!request.images.empty()) {
    auto drifts = BySilhouettes(request, *snapshot, cell, checked.sizes);
    if (!drifts.ok()) return drifts.status();
    for (size_t i = 0; i < drifts->size(); ++i) {
      if (request.corners.empty()) {
        checked.drifts.push_back((*drifts)[i]);
      } else {
        checked.drifts[i] = Worse(checked.drifts[i], (*drifts)[i]);
      }
    }
  }
  for (const ViewDrift& drift : checked.drifts) {
    checked.check.views.push_back(Summary(drift, request.limit));
  }
  return checked;
}

}  // namespace silhouette
