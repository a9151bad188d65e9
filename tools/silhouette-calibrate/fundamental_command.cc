// SPDX-License-Identifier: Apache-2.0
// silhouette-calibrate fundamental
#include <algorithm>
#include <filesystem>
#include <iostream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "calib/fundamental/view_pairs.h"
#include "common/picture/files.h"
#include "common/result/result.h"
#include "db/status/status_macros.h"
#include "server/scene/scene_settings.h"
#include "tools/program/program.h"
#include "tools/silhouette-calibrate/calibration_output.h"
#include "tools/silhouette-calibrate/commands.h"
#include "tools/silhouette-calibrate/files.h"
#include "tools/silhouette-calibrate/fundamental_views.h"
#include "tools/silhouette-calibrate/pictures.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;

struct FundamentalArguments {
  std::string corners;
  ViewSources sources;
  PairSettings settings;
  bool skip_refused = false;
  std::string out;
  std::string calibration;
  std::string fixed_tags;
  std::string draw;
  std::vector<std::string> images;
  std::string frame;
  std::string format = "text";
};

struct Found {
  std::vector<TagSighting> sightings;
  std::vector<PairedView> views;
  std::vector<PairResult> pairs;

  bool AnyRefused() const {
    return std::any_of(pairs.begin(), pairs.end(),
                       [](const PairResult& pair) { return pair.refusal.has_value(); });
  }
};

absl::StatusOr<Found> Find(const FundamentalArguments& arguments) {
  if (arguments.corners.empty() && arguments.sources.cameras.empty()) {
    return absl::InvalidArgumentError(
        "give --corners, for weak calibration straight from tags, or --cameras, a folder of camera "
        "models");
  }
  Found found;
  if (!arguments.corners.empty()) {
    ASSIGN_OR_RETURN(found.sightings, ReadSightings(arguments.corners));
  }
  ASSIGN_OR_RETURN(found.views, PairedViews(arguments.sources, found.sightings));
  found.pairs = FindPairs(found.views, found.sightings, arguments.settings);
  return found;
}

// What bands are drawn of: cameras where all are known, else the matrices that are not refused.
Calibration CalibrationOf(const Found& found, bool of_models) {
  Calibration calibration;
  if (of_models) {
    for (const PairedView& view : found.views) calibration.cameras.push_back(*view.camera);
    return calibration;
  }
  for (const PairResult& pair : found.pairs) {
    if (pair.f.norm() > 0) {
      calibration.fundamental_matrices.push_back({pair.a, pair.b, pair.f_of_masks});
    }
  }
  return calibration;
}

// The frame in which most corners were seen.
std::string BestFrame(const std::vector<TagSighting>& sightings) {
  std::map<std::string, int> seen;
  for (const TagSighting& sighting : sightings) ++seen[sighting.frame];
  const auto most = std::max_element(
      seen.begin(), seen.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
  return most == seen.end() ? "" : most->first;
}

absl::StatusOr<std::map<std::string, Picture>> ReadImages(const FundamentalArguments& arguments,
                                                          const Found& found) {
  std::map<std::string, Picture> images;
  for (const PairedView& view : found.views) {
    for (const std::string& given : arguments.images) {
      std::string file;
      if (given.starts_with(view.name + "=")) {
        file = given.substr(view.name.size() + 1);
      } else if (fs::is_directory(given)) {
        file = (fs::path(given) / (view.name + ".png")).string();
        if (!fs::exists(file)) continue;
      } else {
        continue;
      }
      const Picture image = cv::imread(file, cv::IMREAD_COLOR);
      if (image.empty()) return absl::NotFoundError(absl::StrCat("'", file, "' is no image"));
      images[view.name] = image;
    }
  }
  if (images.empty() && !arguments.images.empty()) {
    return absl::NotFoundError(
        "--images has no image of any view; give a folder with VIEW.png, or VIEW=FILE");
  }
  return images;
}

absl::StatusOr<std::vector<std::string>> DrawBands(const FundamentalArguments& arguments,
                                                   const Found& found, bool of_models) {
  ASSIGN_OR_RETURN(auto images, ReadImages(arguments, found));
  RETURN_IF_ERROR(MakeFolder(arguments.draw));
  const Calibration calibration = CalibrationOf(found, of_models);
  // An image shows one frame.
  const bool any_frame = arguments.images.empty() || !arguments.frame.empty();
  const std::string frame = any_frame ? arguments.frame : BestFrame(found.sightings);
  std::vector<std::string> written;
  for (const PairResult& pair : found.pairs) {
    if (pair.f.norm() == 0) continue;
    const BandPictures pictures{.views = found.views,
                                .calibration = calibration,
                                .margin = of_models ? 0 : pair.margin,
                                .sightings = found.sightings,
                                .frame = frame,
                                .images = images};
    const std::string name =
        absl::StrCat("bands_", found.views[static_cast<size_t>(pair.a)].name, "_",
                     found.views[static_cast<size_t>(pair.b)].name, ".png");
    written.push_back((fs::path(arguments.draw) / name).string());
    RETURN_IF_ERROR(WritePng(written.back(), PaintBands(pictures, pair.a, pair.b)));
  }
  return written;
}

// calibration.yaml; what an earlier one says of the same cameras stays.
absl::Status WriteRecord(const FundamentalArguments& arguments, const FoundCalibration& found) {
  std::optional<storage::v1::CalibrationRecord> record = RecordOfFile(found, arguments.calibration);
  if (!record) {
    record.emplace();
    record->set_program(absl::StrCat("silhouette-calibrate fundamental, ",
                                     found.cameras.empty() ? "weak calibration" : "camera models"));
  }
  if (!arguments.fixed_tags.empty()) {
    ASSIGN_OR_RETURN(const auto fixed, ReadSightings(arguments.fixed_tags));
    RETURN_IF_ERROR(SetFixedTags(found, fixed, *record));
  }
  return WriteCalibrationFile(found, *std::move(record), arguments.calibration);
}

absl::StatusOr<ExitCode> FundamentalWork(const FundamentalArguments& arguments) {
  ASSIGN_OR_RETURN(const Found found, Find(arguments));
  const bool of_models = !arguments.sources.cameras.empty();
  std::vector<std::string> written;
  if (!arguments.draw.empty()) {
    ASSIGN_OR_RETURN(written, DrawBands(arguments, found, of_models));
  }
  const bool refused = found.AnyRefused() && !arguments.skip_refused;
  const FoundCalibration calibration{
      .views = found.views, .pairs = found.pairs, .cameras = arguments.sources.cameras};
  if (!arguments.out.empty() && !refused) {
    RETURN_IF_ERROR(WriteMatrices(calibration, arguments.out));
    written.push_back(arguments.out);
  }
  if (!arguments.calibration.empty() && (!refused || of_models)) {
    RETURN_IF_ERROR(WriteRecord(arguments, calibration));
    written.push_back(arguments.calibration);
  }
  nlohmann::ordered_json json = PairsJson(found.views, found.pairs);
  json["files"] = written;
  PrintResult(arguments.format, json,
              PairsText(found.views, found.pairs, !of_models || !arguments.out.empty()) +
                  TextOfFiles(written));
  // With camera models alone, a refused matrix is still an answer.
  if (!refused || (of_models && arguments.out.empty())) return kDone;
  std::cerr << "silhouette-calibrate: "
            << (arguments.out.empty() ? ""
                                      : "nothing is imported from a doubtful matrix: '" +
                                            arguments.out + "' is not written; ")
            << "fix the refused pairs, or leave them without lines (--skip-refused)" << std::endl;
  return kNo;
}

}  // namespace

void AddFundamentalCommand(CLI::App& program, Run& run) {
  CLI::App* command = program.add_subcommand(
      "fundamental", "Fundamental matrices of all pairs of views, and pictures of their bands");
  auto arguments = std::make_shared<FundamentalArguments>();
  FundamentalArguments& a = *arguments;
  a.settings.most_margin = CalibrationSettings{}.margin;
  command->add_option("--corners", a.corners,
                      "Corners of tags (CSV), for weak calibration; with --cameras "
                      "they test the camera models");
  command->add_option("--cameras", a.sources.cameras, "Folder of camera models, VIEW.cameramodel");
  command->add_option("--cell", a.sources.cell,
                      "The cell file: names of the views, sizes of images and masks");
  command->add_option("--image-size", a.sources.image_size,
                      "WIDTHxHEIGHT of all views' camera images, without --cell");
  command->add_option("--mask-size", a.sources.mask_size,
                      "WIDTHxHEIGHT of all views' masks, without --cell");
  command->add_option("--out", a.out, "YAML file of matrices for silhouette-db calibration import");
  command->add_option(
      "--calibration", a.calibration,
      "calibration.yaml to write for silhouette-db calibration import: the cameras, "
      "else the matrices, with their figures of merit. Entries of an existing file about these "
      "cameras are kept");
  command
      ->add_option("--fixed-tags", a.fixed_tags,
                   "Corners (CSV) of tags that stay in the cell, for --calibration; 'check' "
                   "uses them to see whether a camera moved")
      ->needs("--calibration");
  command
      ->add_option("--max-margin", a.settings.most_margin,
                   "Margin in mask pixels that a matrix may need: 'calibration.margin' of the "
                   "server's cell file")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command->add_flag("--skip-refused", a.skip_refused,
                    "Write the other pairs' matrices; those refused have no lines");
  command->add_flag("--undistorted-images", a.settings.undistorted_images,
                    "With --cameras: the masks are made of images without distortion");
  command->add_option("--seed", a.settings.seed, "Of the random samples")->capture_default_str();
  command->add_option("--draw", a.draw, "Folder for pictures of bands, one per pair of views");
  command
      ->add_option("--images", a.images,
                   "Camera images to draw over: a folder with VIEW.png, or VIEW=FILE each")
      ->needs("--draw");
  command
      ->add_option(
          "--frame", a.frame,
          "The frame whose corners are drawn; default: all, over images that with most tags")
      ->needs("--draw");
  AddFormatOption(*command, a.format);
  command->footer(
      "Weak calibration needs no camera model, no board size and no robot. It needs frames in "
      "which "
      "two views\n"
      "see the same tags, and lenses without distortion.\n"
      "Examples:\n"
      "  silhouette-calibrate fundamental --corners corners.csv --cell cell.yaml --out "
      "matrices.yaml --draw bands\n"
      "  silhouette-calibrate fundamental --cameras cameras --corners other.csv --mask-size 64x64");
  command->callback(
      [arguments, &run] { run = [arguments] { return FundamentalWork(*arguments); }; });
}

}  // namespace silhouette
