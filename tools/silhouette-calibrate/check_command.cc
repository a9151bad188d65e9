// SPDX-License-Identifier: Apache-2.0
// silhouette-calibrate check
#include <algorithm>
#include <filesystem>
#include <iostream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <numbers>
#include <opencv2/core/mat.hpp>
#include <opencv2/imgcodecs.hpp>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "calib/boards/sighting_file.h"
#include "calib/files/calibration_check_file.h"
#include "calib/files/calibration_message.h"
#include "calib/fundamental/tag_drift.h"
#include "capture/session/silhouette_drift.h"
#include "common/picture/files.h"
#include "common/result/result.h"
#include "db/mask/configuration_grid.h"
#include "db/status/status_macros.h"
#include "db/store/store.h"
#include "silhouette/storage/v1/storage.pb.h"
#include "tools/cell/cell.h"
#include "tools/program/program.h"
#include "tools/silhouette-calibrate/calibration_output.h"
#include "tools/silhouette-calibrate/cell_now.h"
#include "tools/silhouette-calibrate/commands.h"
#include "tools/silhouette-calibrate/files.h"
#include "tools/silhouette-calibrate/pictures.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;

struct Checked {
  CalibrationCheck check;
  bool looked = false;            // cameras were opened for it
  std::vector<ViewDrift> drifts;  // per view
  std::vector<ViewSizes> sizes;
};

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
    for (int i = 0; i + 1 < tag.corners_size(); i += 2) {
      sighting.corners.emplace_back(tag.corners(i), tag.corners(i + 1));
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
                                     const storage::v1::CellDescription& cell,
                                     const std::vector<ViewSizes>& sizes) {
  if (!request.reference.empty()) {
    ASSIGN_OR_RETURN(const auto sightings, ReadSightingsOf(cell, request.reference));
    Sightings means;
    for (int i = 0; i < cell.views_size(); ++i) {
      auto of_view = MeanSightings(cell.views(i).name(), sizes[static_cast<size_t>(i)], sightings);
      if (!of_view.ok()) {
        return InvalidArgument(request.reference, ": ", of_view.status().message());
      }
      means.merge(*of_view);
    }
    return means;
  }
  Sightings before = FixedTagsOf(stored.record(), cell);
  if (!before.empty()) return before;
  return FailedPrecondition(
      "the stored calibration has no corners of tags that stay in the cell; give --reference, "
      "their corners at calibration time, or import a calibration.yaml with fixed_tags");
}

absl::StatusOr<std::vector<ViewDrift>> ByTags(const CheckRequest& request,
                                              const storage::v1::Calibration& stored,
                                              const storage::v1::CellDescription& cell,
                                              const std::vector<ViewSizes>& sizes,
                                              const CellNow& now) {
  ASSIGN_OR_RETURN(const Sightings before, TagsOfThen(request, stored, cell, sizes));
  std::vector<ViewDrift> drifts;
  for (size_t i = 0; i < sizes.size(); ++i) {
    const std::string& view = cell.views(static_cast<int>(i)).name();
    const auto after = MeanSightings(view, sizes[i], *now.tags);
    if (after.ok()) {
      drifts.push_back(
          DriftByTags(view, sizes[i], before, *after, !now.without_noise.contains(view)));
    } else {
      ViewDrift& drift = drifts.emplace_back();
      drift.view = view;
      drift.method = "tags";
      drift.message = std::string(after.status().message());
    }
  }
  return drifts;
}

absl::StatusOr<std::vector<ViewDrift>> BySilhouettes(const CheckRequest& request,
                                                     const Snapshot& snapshot,
                                                     const storage::v1::CellDescription& cell,
                                                     const std::vector<ViewSizes>& sizes,
                                                     const std::vector<cv::Mat>& images) {
  ASSIGN_OR_RETURN(const Cell file, CellFor(request, cell));
  ASSIGN_OR_RETURN(const auto robot, snapshot.Find(*request.number));
  if (!robot || robot->excluded) {
    return NotFound("configuration ", *request.number, " has no robot images");
  }
  ASSIGN_OR_RETURN(const auto references, snapshot.References());
  if (!references) {
    return FailedPrecondition("the database has no reference images to difference with");
  }
  std::vector<ViewDrift> drifts;
  for (int i = 0; i < cell.views_size(); ++i) {
    const std::string& name = cell.views(i).name();
    const cv::Mat& image = images[static_cast<size_t>(i)];
    const storage::v1::Reference& png = references->views(i);
    ASSIGN_OR_RETURN(const Reference reference,
                     Reference::FromPng(png.mean_png(), png.noise_png()));
    if (image.size() != reference.size()) {
      return InvalidArgument("the image of '", name, "' is not of the size of its reference image");
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
      return FailedPrecondition("the database does not say how large the images of view '",
                                view.name(),
                                "' are; state image_size in the cell file and capture with it");
    }
    sizes.push_back({.image = {view.image_width(), view.image_height()},
                     .mask = {view.mask_width(), view.mask_height()}});
  }
  return sizes;
}

absl::Status CheckAsked(const CheckRequest& request) {
  if (request.live && request.boards.empty() && !request.number) {
    return InvalidArgument(
        "--live needs --boards, those whose tags stay in the cell, or --number, the configuration "
        "in which the robot is parked");
  }
  if (!request.live && request.corners.empty() && request.images.empty()) {
    return InvalidArgument(
        "give --corners, tags as they are seen now, or --images of the parked robot, or --live");
  }
  if (!request.images.empty() && (!request.number || request.cell.empty())) {
    return InvalidArgument(
        "--images needs --number, the configuration in which the robot is parked, and --cell");
  }
  if (!request.live && request.images.empty() && request.number) {
    return InvalidArgument(
        "--number compares the parked robot in --images or --live; give one of these, or leave it "
        "out");
  }
  return absl::OkStatus();
}

// If both checks ran for a view, the result is the larger motion. If one requested check could not
// run, the view is not checked, unless the other one found a motion beyond the limit. Errors name
// what is missing; `checked` then has the views, as far as they are known, as not checked.
absl::Status CheckViews(const CheckRequest& request, Checked& checked) {
  checked.check.time = absl::Now();
  checked.check.limit_mask_px = request.limit;
  RETURN_IF_ERROR(CheckAsked(request));
  ASSIGN_OR_RETURN(const auto database, Database::Open(request.database, Database::Access::kRead));
  ASSIGN_OR_RETURN(const Snapshot snapshot, database->Read());
  ASSIGN_OR_RETURN(const auto stored, snapshot.Calibration());
  if (!stored) {
    return FailedPrecondition(
        "'", request.database,
        "' has no calibration to check; import one with 'silhouette-db calibration "
        "import'");
  }
  const storage::v1::CellDescription& cell = database->cell();
  checked.check.calibration = FingerprintOf(*stored);
  for (const storage::v1::View& view : cell.views()) {
    checked.check.views.emplace_back().name = view.name();
  }
  ASSIGN_OR_RETURN(checked.sizes, SizesOf(cell));
  ASSIGN_OR_RETURN(const CellNow now, NowOf(request, cell, checked.looked));
  checked.check.time = std::min(checked.check.time, now.written);
  if (now.tags) {
    ASSIGN_OR_RETURN(checked.drifts, ByTags(request, *stored, cell, checked.sizes, now));
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
  for (size_t i = 0; i < checked.drifts.size(); ++i) {
    checked.check.views[i] = Summary(checked.drifts[i], request.limit);
  }
  return absl::OkStatus();
}

struct CheckArguments {
  CheckRequest request;
  std::string out;
  std::string draw;
  std::string format = "text";
};

absl::Status Draw(const std::string& folder, const Checked& checked) {
  RETURN_IF_ERROR(MakeFolder(folder));
  for (size_t i = 0; i < checked.drifts.size(); ++i) {
    const ViewDrift& drift = checked.drifts[i];
    const std::string file = (fs::path(folder) / absl::StrCat("check_", drift.view, ".png"));
    RETURN_IF_ERROR(
        WritePng(file, PaintDrift(drift, checked.sizes[i], checked.check.limit_mask_px)));
  }
  return absl::OkStatus();
}

double Degrees(double radians) { return radians * 180 / std::numbers::pi; }

std::string TextOf(const Checked& checked) {
  std::string text;
  for (size_t i = 0; i < checked.drifts.size(); ++i) {
    const ViewDrift& drift = checked.drifts[i];
    if (!drift.checked) {
      absl::StrAppend(&text, drift.view, ": not checked: ", drift.message, "\n");
      continue;
    }
    absl::StrAppendFormat(&text, "%s: %s by up to %.2f px (%.3f mask px): shift (%.2f, %.2f) px",
                          drift.view, checked.check.views[i].holds ? "holds, moved" : "MOVED",
                          drift.moved, drift.moved_mask, drift.shift.x(), drift.shift.y());
    if (drift.corners > 0) {
      absl::StrAppendFormat(&text, ", turn %.3f deg, growth %.2f %%; %d corners, %.3f px rms left",
                            Degrees(drift.turn), 100 * drift.scale, drift.corners, drift.rms_left);
    } else {
      absl::StrAppendFormat(&text, ", turn %.2f deg", Degrees(drift.turn));
    }
    absl::StrAppend(&text, drift.message.empty() ? "" : "; ", drift.message, "\n");
  }
  absl::StrAppendFormat(&text, "limit %.3g mask px: the calibration %s\n",
                        checked.check.limit_mask_px,
                        checked.check.Holds() ? "holds" : "is not known to hold");
  return text;
}

nlohmann::ordered_json JsonOf(const Checked& checked) {
  auto json = nlohmann::ordered_json::parse(CheckFileText(checked.check));
  for (size_t i = 0; i < checked.drifts.size(); ++i) {
    const ViewDrift& drift = checked.drifts[i];
    nlohmann::ordered_json& view = json["views"][i];
    view["corners"] = drift.corners;
    view["shift_px"] = {drift.shift.x(), drift.shift.y()};
    view["turn_deg"] = Degrees(drift.turn);
    view["growth"] = drift.scale;
    view["rms_left_px"] = drift.rms_left;
    view["odd_tags"] = nlohmann::ordered_json::array();
    for (const auto& [name, family, tag] : drift.odd_tags) {
      view["odd_tags"].push_back({{"family", family}, {"tag", tag}});
    }
  }
  return json;
}

absl::StatusOr<ExitCode> CheckWork(const CheckArguments& arguments) {
  CatchStopSignals();
  Checked checked;
  const absl::Status done = CheckViews(arguments.request, checked);
  if (absl::IsCancelled(done) || (!done.ok() && !checked.looked)) return done;
  for (CheckedView& view : checked.check.views) {
    if (!done.ok()) view.message = std::string(done.message());
  }
  if (!arguments.out.empty()) {
    // A server may be reading the one that is there: it stays whole. If a device failed the earlier
    // result does not stay in force.
    RETURN_IF_ERROR(WriteWholeFile(arguments.out, CheckFileText(checked.check)));
  }
  RETURN_IF_ERROR(done);
  if (!arguments.draw.empty()) {
    RETURN_IF_ERROR(Draw(arguments.draw, checked));
  }
  PrintResult(arguments.format, JsonOf(checked), TextOf(checked));
  return checked.check.Holds() ? kDone : kNo;
}

}  // namespace

void AddCheckCommand(CLI::App& program, Run& run) {
  CLI::App* command = program.add_subcommand(
      "check",
      "Check whether the stored calibration still holds: report how far each camera moved");
  auto arguments = std::make_shared<CheckArguments>();
  CheckArguments& a = *arguments;
  command->add_option("--database", a.request.database, "The folder of the database")->required();
  command->add_option("--corners", a.request.corners,
                      "Current corners (CSV) of tags that stay in the cell");
  command->add_option(
      "--reference", a.request.reference,
      "Corners of the same tags at calibration time; default: those in the imported "
      "calibration.yaml");
  command->add_option("--images", a.request.images,
                      "Folder with a current image of every view, VIEW.png: the silhouette of the "
                      "parked robot is compared with its mask");
  command->add_option("--number", a.request.number,
                      "The configuration in which the robot is parked, for --images or --live");
  auto* cell =
      command->add_option("--cell", a.request.cell,
                          "The cell file, for --images and --live; with --corners it names\n"
                          "views without noise, whose corners may be those of the calibration");
  auto* live = command
                   ->add_flag("--live", a.request.live,
                              "Take the images from the cell's cameras: for the tags of --boards, "
                              "and for the parked robot with --number")
                   ->needs(cell)
                   ->excludes("--corners")
                   ->excludes("--images");
  command
      ->add_option("--boards", a.request.boards,
                   "Live: the boards (YAML) whose tags stay in the cell; several files")
      ->needs(live);
  command
      ->add_option("--sets", a.request.sets, "Live: images of each view whose mean corners count")
      ->needs(live)
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  command
      ->add_option("--limit", a.request.limit, "How much a camera may have moved, in mask pixels")
      ->check(PositiveNumber())
      ->capture_default_str();
  command->add_option("--out", a.out,
                      "JSON file of the result, for silhouette-server --calibration-check");
  command->add_option("--draw", a.draw, "Folder for a picture per view");
  AddFormatOption(*command, a.format);
  command->footer(
      "Checks tags, the silhouette of the robot, or both; of both, the larger motion counts.\n"
      "Exit code 1 if a camera moved by more than the limit, or could not be checked. If a "
      "device\nfails, --out states that no view was checked.\n"
      "Without --live the result is as old as the oldest of the files of --corners and --images.\n"
      "Example:\n"
      "  silhouette-calibrate check --database cell.lmdb --corners now.csv --out check.json\n"
      "  silhouette-calibrate check --database cell.lmdb --cell cell.yaml --images now --number 0\n"
      "  silhouette-calibrate check --database cell.lmdb --cell cell.yaml --live --boards "
      "floor.yaml "
      "--out check.json");
  command->callback([arguments, &run] { run = [arguments] { return CheckWork(*arguments); }; });
}

}  // namespace silhouette
