// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-calibrate/check_views.h"

#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/time/clock.h"
#include "calib/boards/sighting_file.h"
#include "calib/detection/image_tags.h"
#include "calib/files/calibration_message.h"
#include "capture/session/cell_cameras.h"
#include "capture/session/silhouette_drift.h"
#include "common/picture/files.h"
#include "db/status/status_macros.h"
#include "db/store/store.h"
#include "tools/cell/cell.h"
#include "tools/cell/devices/cell_devices.h"
#include "tools/program/program.h"
#include "tools/silhouette-calibrate/detect.h"
#include "tools/silhouette-calibrate/files.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;

struct CellNow {
  std::optional<std::map<SeenTag, TagSighting>> tags;  // nothing: they were not asked for
  std::vector<cv::Mat> images;                         // by view; empty: as before
};

struct LiveLook {
  std::vector<std::string> boards;  // files of those whose tags stay in the cell; empty: no tags
  // Where the robot is parked; nothing: no images are asked for.
  std::optional<Configuration> parked;
  int sets = 0;  // of images, in which tags are looked for
};

// Adds the tags that a set of images shows.
absl::Status AddTags(const DetectSettings& settings, TagDetector& detector, const Cell& cell,
                     const ImageSet& set, const std::string& frame,
                     std::vector<TagSighting>& sightings) {
  for (size_t v = 0; v < cell.views.size(); ++v) {
    ASSIGN_OR_RETURN(const auto seen,
                     Look(settings, detector, GreyOf(set.images[v]), cell.views[v].name, frame));
    const std::vector<TagSighting> tags = SightingsOf(seen);
    sightings.insert(sightings.end(), tags.begin(), tags.end());
  }
  return absl::OkStatus();
}

absl::StatusOr<std::map<SeenTag, TagSighting>> LookForTags(const LiveLook& look, const Cell& cell,
                                                           CellCameras& cameras, ImageSet& last) {
  DetectArguments arguments;
  arguments.boards = look.boards;
  ASSIGN_OR_RETURN(const auto settings, LoadDetectSettings(arguments, {}));
  TagDetector detector(settings.families);
  std::vector<TagSighting> sightings;
  for (int i = 0; i < look.sets; ++i) {
    if (StopRequested()) return absl::AbortedError("stopped; nothing is known of the cameras");
    ASSIGN_OR_RETURN(last, GrabSet(cameras));
    RETURN_IF_ERROR(AddTags(settings, detector, cell, last, absl::StrCat(i), sightings));
  }
  if (sightings.empty()) {
    return absl::NotFoundError(
        absl::StrCat("no camera of the cell sees a tag of ", absl::StrJoin(look.boards, ", "),
                     "; are they the boards that stay in the cell, and is the light on?"));
  }
  return MeanSightings(sightings);
}

// A sighting file's tags, each the mean of all frames. InvalidArgument, naming the file.
absl::StatusOr<std::map<SeenTag, TagSighting>> ReadMeanSightings(const std::string& file) {
  ASSIGN_OR_RETURN(const std::vector<TagSighting> sightings, ReadSightings(file));
  auto means = MeanSightings(sightings);
  if (means.ok()) return means;
  return absl::Status(means.status().code(), absl::StrCat(file, ": ", means.status().message()));
}

// From files; an empty name skips its check. `images`: folder with VIEW.png.
absl::StatusOr<CellNow> ReadNow(const std::string& corners, const std::string& images,
                                const storage::v1::CellDescription& cell) {
  CellNow now;
  if (!corners.empty()) {
    ASSIGN_OR_RETURN(now.tags, ReadMeanSightings(corners));
  }
  for (int i = 0; i < cell.views_size() && !images.empty(); ++i) {
    const std::string file = (fs::path(images) / (cell.views(i).name() + ".png")).string();
    now.images.push_back(cv::imread(file, cv::IMREAD_COLOR));
    if (now.images.back().empty()) return absl::NotFoundError("'" + file + "' is no image");
  }
  return now;
}

// From the cell's cameras. NotFound if no tag of the boards is seen; Aborted if a stop was asked
// for; else the errors of files and cameras.
absl::StatusOr<CellNow> LookNow(const LiveLook& look, const Cell& cell) {
  auto rig = OpenCamerasOfCell(cell, false, look.parked);
  if (!rig.ok()) {
    return absl::Status(rig.status().code(),
                        absl::StrCat(rig.status().message(),
                                     "; or take the images otherwise and give them (--images, or "
                                     "--corners of them)"));
  }
  ASSIGN_OR_RETURN(auto cameras, CellCameras::Create(DescriptionOf(cell), **rig));
  CellNow now;
  ImageSet set;
  if (!look.boards.empty()) {
    ASSIGN_OR_RETURN(now.tags, LookForTags(look, cell, cameras, set));
  } else {
    ASSIGN_OR_RETURN(set, GrabSet(cameras));
  }
  for (const cv::Mat& image : set.images) {
    if (!look.parked) break;
    cv::Mat colour = image;
    if (image.channels() == 1) cv::cvtColor(image, colour, cv::COLOR_GRAY2BGR);
    now.images.push_back(colour);
  }
  return now;
}

using Sightings = std::map<SeenTag, TagSighting>;

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
  if (!request.reference.empty()) return ReadMeanSightings(request.reference);
  Sightings before = FixedTagsOf(stored.record(), cell);
  if (!before.empty()) return before;
  return absl::FailedPreconditionError(
      "the stored calibration has no corners of tags that stay in the cell; give --reference, "
      "their corners at calibration time, or import a calibration.yaml with fixed_tags");
}

absl::StatusOr<std::vector<ViewDrift>> ByTags(const CheckRequest& request,
                                              const storage::v1::Calibration& stored,
                                              const storage::v1::CellDescription& cell,
                                              const std::vector<ViewSizes>& sizes,
                                              const Sightings& after) {
  ASSIGN_OR_RETURN(const Sightings before, TagsOfThen(request, stored, cell));
  std::vector<ViewDrift> drifts;
  for (int i = 0; i < cell.views_size(); ++i) {
    drifts.push_back(
        DriftByTags(cell.views(i).name(), sizes[static_cast<size_t>(i)], before, after));
  }
  return drifts;
}

// The cell file, if it is of the database.
absl::StatusOr<Cell> CellFor(const CheckRequest& request,
                             const storage::v1::CellDescription& cell) {
  absl::StatusOr<Cell> file = LoadCell(request.cell);
  if (!file.ok()) return file;
  const std::vector<std::string> differences =
      Differences(DescriptionOf(*file), "the cell file", cell, "the database");
  if (differences.empty()) return file;
  return absl::FailedPreconditionError(absl::StrCat("the database '", request.database,
                                                    "' does not fit the cell file '", request.cell,
                                                    "': ", absl::StrJoin(differences, "; ")));
}

absl::StatusOr<CellNow> NowOf(const CheckRequest& request,
                              const storage::v1::CellDescription& description) {
  if (!request.live) return ReadNow(request.corners, request.images, description);
  ASSIGN_OR_RETURN(const Cell cell, CellFor(request, description));
  LiveLook look{.boards = request.boards, .parked = std::nullopt, .sets = request.sets};
  if (request.number) {
    if (!cell.grid.Contains(*request.number)) {
      return absl::NotFoundError(
          absl::StrCat("no configuration has the number ", *request.number,
                       "; 'silhouette-db show --at' reports the number nearest to joint values"));
    }
    look.parked = cell.grid.At(*request.number);
  }
  return LookNow(look, cell);
}

absl::StatusOr<std::vector<ViewDrift>> BySilhouettes(const CheckRequest& request,
                                                     const Snapshot& snapshot,
                                                     const storage::v1::CellDescription& cell,
                                                     const std::vector<ViewSizes>& sizes,
                                                     const std::vector<cv::Mat>& images) {
  ASSIGN_OR_RETURN(const Cell file, CellFor(request, cell));
  ASSIGN_OR_RETURN(const auto robot, snapshot.Find(*request.number));
  if (!robot || robot->excluded) {
    return absl::NotFoundError(
        absl::StrCat("configuration ", *request.number, " has no robot images"));
  }
  ASSIGN_OR_RETURN(const auto references, snapshot.References());
  if (!references) {
    return absl::FailedPreconditionError("the database has no reference images to difference with");
  }
  std::vector<ViewDrift> drifts;
  for (int i = 0; i < cell.views_size(); ++i) {
    const std::string& name = cell.views(i).name();
    const cv::Mat& image = images[static_cast<size_t>(i)];
    const storage::v1::Reference& png = references->views(i);
    ASSIGN_OR_RETURN(const Reference reference,
                     Reference::FromPng(png.mean_png(), png.noise_png()));
    if (image.size() != reference.size()) {
      return absl::InvalidArgumentError(
          absl::StrCat("the image of '", name, "' is not of the size of its reference image"));
    }
    drifts.push_back(DriftBySilhouette(name, sizes[static_cast<size_t>(i)], image, reference,
                                       file.segmentation, robot->masks[static_cast<size_t>(i)]));
  }
  return drifts;
}

// If both checks ran for a view, the larger motion counts. A motion that one check sees is reported
// even if the other check could not run.
ViewDrift Worse(const ViewDrift& one, const ViewDrift& other, double limit) {
  if (!one.checked || !other.checked) {
    const ViewDrift& seen = one.checked ? one : other;
    const ViewDrift& unseen = one.checked ? other : one;
    return seen.checked && seen.moved_mask > limit ? seen : unseen;
  }
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

absl::Status CheckAsked(const CheckRequest& request) {
  if (request.live && request.boards.empty() && !request.number) {
    return absl::InvalidArgumentError(
        "--live needs --boards, those whose tags stay in the cell, or --number, the configuration "
        "in which the robot is parked");
  }
  if (!request.live && request.corners.empty() && request.images.empty()) {
    return absl::InvalidArgumentError(
        "give --corners, tags as they are seen now, or --images of the parked robot, or --live");
  }
  if (!request.images.empty() && (!request.number || request.cell.empty())) {
    return absl::InvalidArgumentError(
        "--images needs --number, the configuration in which the robot is parked, and --cell");
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<Checked> CheckViews(const CheckRequest& request) {
  RETURN_IF_ERROR(CheckAsked(request));
  ASSIGN_OR_RETURN(const auto database, Database::Open(request.database, Database::Access::kRead));
  ASSIGN_OR_RETURN(const Snapshot snapshot, database->Read());
  ASSIGN_OR_RETURN(const auto stored, snapshot.Calibration());
  if (!stored) {
    return absl::FailedPreconditionError(
        absl::StrCat("'", request.database,
                     "' has no calibration to check; import one with 'silhouette-db calibration "
                     "import'"));
  }
  const storage::v1::CellDescription& cell = database->cell();
  Checked checked;
  ASSIGN_OR_RETURN(checked.sizes, SizesOf(cell));
  checked.check.time = absl::Now();
  checked.check.calibration = FingerprintOf(*stored);
  checked.check.limit_mask_px = request.limit;
  ASSIGN_OR_RETURN(const CellNow now, NowOf(request, cell));
  if (now.tags) {
    ASSIGN_OR_RETURN(checked.drifts, ByTags(request, *stored, cell, checked.sizes, *now.tags));
  }
  if (!now.images.empty()) {
    ASSIGN_OR_RETURN(auto drifts,
                     BySilhouettes(request, snapshot, cell, checked.sizes, now.images));
    for (size_t i = 0; i < drifts.size(); ++i) {
      if (!now.tags) {
        checked.drifts.push_back(drifts[i]);
      } else {
        checked.drifts[i] = Worse(checked.drifts[i], drifts[i], request.limit);
      }
    }
  }
  for (const ViewDrift& drift : checked.drifts) {
    checked.check.views.push_back(Summary(drift, request.limit));
  }
  return checked;
}

}  // namespace silhouette
