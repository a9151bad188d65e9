// SPDX-License-Identifier: Apache-2.0
// silhouette-calibrate fundamental
#include <algorithm>
#include <filesystem>
#include <iostream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <nlohmann/json_fwd.hpp>
#include <opencv2/imgcodecs.hpp>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "calib/boards/sighting_file.h"
#include "calib/files/camera_file.h"
#include "calib/fundamental/correspondences.h"
#include "calib/fundamental/view_pairs.h"
#include "common/picture/files.h"
#include "common/picture/image_file.h"
#include "common/result/result.h"
#include "db/status/status_macros.h"
#include "server/scene/scene_settings.h"
#include "tools/cell/cell.h"
#include "tools/program/program.h"
#include "tools/silhouette-calibrate/calibration_output.h"
#include "tools/silhouette-calibrate/commands.h"
#include "tools/silhouette-calibrate/files.h"
#include "tools/silhouette-calibrate/pictures.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;

// Sources of the views; empty: not given.
struct ViewSources {
  std::string cell;     // cell.yaml: names and sizes
  std::string cameras;  // folder of .cameramodel files
  std::string image_size;
  std::string mask_size;
};

absl::StatusOr<std::vector<PairedView>> NamedViews(const ViewSources& sources,
                                                   std::span<const TagSighting> sightings) {
  std::vector<PairedView> views;
  if (!sources.cell.empty()) {
    ASSIGN_OR_RETURN(const Cell cell, LoadCell(sources.cell));
    for (const ViewSettings& view : cell.views) {
      views.push_back({.name = view.name,
                       .sizes = {.image = {view.image_width, view.image_height},
                                 .mask = {view.mask_size.width, view.mask_size.height}},
                       .camera = std::nullopt});
    }
    return views;
  }
  std::vector<std::string> names = ViewsOf(sightings);
  if (!sources.cameras.empty()) {
    ASSIGN_OR_RETURN(const std::vector<CameraFile> cameras, ReadCameraFolder(sources.cameras));
    names.clear();
    for (const CameraFile& camera : cameras) names.push_back(camera.view);
  }
  for (const std::string& name : names) views.push_back({.name = name, .sizes = {}, .camera = {}});
  return views;
}

absl::Status TakeCamera(const std::string& folder, PairedView& view) {
  const std::string file = (fs::path(folder) / CameraFileName(view.name)).string();
  ASSIGN_OR_RETURN(CameraModel camera, ReadCameraFile(file));
  const PixelSize size{camera.intrinsics().width, camera.intrinsics().height};
  if (view.sizes.image.width > 0 && view.sizes.image != size) {
    return InvalidArgument("'", file, "' is for images of ", SizeText(size),
                           ", but those of view '", view.name, "' are ",
                           SizeText(view.sizes.image));
  }
  view.sizes.image = size;
  view.camera = std::move(camera);
  return absl::OkStatus();
}

absl::Status CheckSightings(const std::vector<PairedView>& views,
                            std::span<const TagSighting> sightings) {
  for (const TagSighting& sighting : sightings) {
    const auto view = std::ranges::find(views, sighting.view, &PairedView::name);
    if (view == views.end()) {
      return InvalidArgument(
          "the corners are of a view '", sighting.view, "' that is not there; the views are ",
          absl::StrJoin(views, ", ", [](std::string* out, const PairedView& each) {
            absl::StrAppend(out, each.name);
          }));
    }
    const PixelSize image = view->sizes.image;
    for (const Eigen::Vector2d& corner : sighting.corners) {
      if (corner.x() >= -0.5 && corner.x() <= image.width - 0.5 && corner.y() >= -0.5 &&
          corner.y() <= image.height - 0.5) {
        continue;
      }
      return InvalidArgument("frame '", sighting.frame, "', view '", sighting.view, "', tag ",
                             sighting.tag, ": a corner at (", corner.x(), ", ", corner.y(),
                             ") is not in an image of ", SizeText(image),
                             "; the images' size is wrong, or sizes are mixed");
    }
  }
  return absl::OkStatus();
}

using nlohmann::ordered_json;

ordered_json MatrixJson(const Eigen::Matrix3d& f) {
  ordered_json rows = ordered_json::array();
  for (int row = 0; row < 3; ++row) rows.push_back({f(row, 0), f(row, 1), f(row, 2)});
  return rows;
}

ordered_json DistancesJson(const LineDistances& distances) {
  return {{"corners", distances.corners},
          {"rms_px", distances.rms},
          {"noise_px", distances.noise},
          {"median_px", distances.median},
          {"worst_px", distances.worst}};
}

ordered_json PairJson(const std::vector<PairedView>& views, const PairResult& pair) {
  ordered_json json = {{"view_a", views[static_cast<size_t>(pair.a)].name},
                       {"view_b", views[static_cast<size_t>(pair.b)].name},
                       {"frames", pair.frames},
                       {"corners", pair.corners},
                       {"unseen", pair.unseen},
                       {"refusal", nullptr}};
  if (pair.refusal) json["refusal"] = *pair.refusal;
  if (pair.f.norm() > 0) {
    json["F_of_images"] = MatrixJson(pair.f);
    json["F_of_masks"] = MatrixJson(pair.f_of_masks);
    json["margin"] = pair.margin;
  }
  if (pair.weak && pair.f.norm() > 0) {
    json["outliers"] = pair.weak->outliers;
    json["spread"] = pair.weak->spread;
    json["predicted_margin"] = pair.weak->predicted_margin;
    json["held_out"] = DistancesJson(pair.weak->held_out);
    json["held_out"]["by"] = pair.weak->frames_held_out ? "frames" : "tags";
    json["lenses_bow"] = pair.weak->bowed;
  }
  if (pair.weak) json["warnings"] = pair.weak->warnings;
  if (pair.bow) {
    json["bow"] = {{"curve_px", pair.bow->curve},
                   {"off_lines_px", pair.bow->off_lines},
                   {"margin", pair.bow->margin}};
  }
  if (pair.distances) json["distances"] = DistancesJson(*pair.distances);
  return json;
}

std::string DistancesText(const LineDistances& distances) {
  return absl::StrFormat(
      "%d corners, %.3f px rms from their lines (%.3f by the corners' own sigma), median %.3f, "
      "worst %.2f",
      distances.corners, distances.rms, distances.noise, distances.median, distances.worst);
}

std::string PairText(const PairResult& pair) {
  if (pair.unseen) return "no tag was seen by both at once: the pair has no lines";
  if (pair.weak && pair.f.norm() == 0) return "";
  std::string text;
  if (pair.weak) {
    text = absl::StrFormat("%s held out by %s; %d of %d wrong; margin %.3f mask px",
                           DistancesText(pair.weak->held_out),
                           pair.weak->frames_held_out ? "frames" : "tags", pair.weak->outliers,
                           pair.corners, pair.margin);
  } else if (pair.distances) {
    text = DistancesText(*pair.distances);
  } else {
    text = "from the camera models";
  }
  if (pair.bow && pair.bow->off_lines > 0) {
    absl::StrAppendFormat(
        &text,
        "\n  distortion bows epipolar lines by up to %.1f px and takes points up to %.1f px off "
        "the matrix's: that is\n  true of undistorted pixels only, or with a margin of %.2g mask "
        "pixels; bands of the camera models follow distortion",
        pair.bow->curve, pair.bow->off_lines, pair.bow->margin);
  }
  return text;
}

// In the order of the cell, else of the cameras' files, else of the sightings. InvalidArgument or
// NotFound in a sentence: an unspecified size, a camera that is missing or for another size, a
// sighting of a view that is not there or beyond its image, less than two views.
absl::StatusOr<std::vector<PairedView>> PairedViews(const ViewSources& sources,
                                                    std::span<const TagSighting> sightings) {
  absl::StatusOr<std::vector<PairedView>> views = NamedViews(sources, sightings);
  if (!views.ok()) return views;
  for (PairedView& view : *views) {
    for (const bool of_image : {true, false}) {
      const std::string& text = of_image ? sources.image_size : sources.mask_size;
      if (text.empty()) continue;
      ASSIGN_OR_RETURN(const auto size,
                       SizeFromText(text, of_image ? "--image-size" : "--mask-size"));
      (of_image ? view.sizes.image : view.sizes.mask) = size;
    }
    if (!sources.cameras.empty()) {
      RETURN_IF_ERROR(TakeCamera(sources.cameras, view));
    }
    if (view.sizes.image.width <= 0) {
      view.sizes.image = ImageSizeOf(sightings, view.name).value_or(PixelSize{});
    }
    if (view.sizes.image.width <= 0) {
      return InvalidArgument("how large the images of view '", view.name,
                             "' are is not said; give --cell, "
                             "--image-size or --cameras");
    }
    RETURN_IF_ERROR(
        CheckImageSize(sightings, view.name, view.sizes.image, "the stated image size"));
    if (view.sizes.mask.width <= 0) {
      return InvalidArgument("how large the masks of view '", view.name,
                             "' are is not said; give --cell or "
                             "--mask-size");
    }
  }
  if (views->size() < 2) {
    return InvalidArgument("there must be at least two views to pair");
  }
  RETURN_IF_ERROR(CheckSightings(*views, sightings));
  return views;
}

// In words. `refusals`: whether matrices are wanted, so that it matters which must not be used.
std::string PairsText(const std::vector<PairedView>& views, const std::vector<PairResult>& pairs,
                      bool refusals) {
  std::string text;
  for (const PairResult& pair : pairs) {
    absl::StrAppend(&text, views[static_cast<size_t>(pair.a)].name, " - ",
                    views[static_cast<size_t>(pair.b)].name, ": ", PairText(pair), "\n");
    if (pair.refusal && refusals) absl::StrAppend(&text, "  refused: ", *pair.refusal, "\n");
    if (!pair.weak) continue;
    for (const std::string& warning : pair.weak->warnings) {
      absl::StrAppend(&text, "  note: ", warning, "\n");
    }
  }
  return text;
}

ordered_json PairsJson(const std::vector<PairedView>& views, const std::vector<PairResult>& pairs) {
  ordered_json json = {{"views", ordered_json::array()}, {"pairs", ordered_json::array()}};
  for (const PairedView& view : views) {
    const ViewSizes& sizes = view.sizes;
    json["views"].push_back({{"name", view.name},
                             {"image_size", {sizes.image.width, sizes.image.height}},
                             {"mask_size", {sizes.mask.width, sizes.mask.height}},
                             {"camera", view.camera.has_value()}});
  }
  double margin = 0;
  for (const PairResult& pair : pairs) {
    json["pairs"].push_back(PairJson(views, pair));
    if (!pair.refusal) margin = std::max(margin, pair.margin);
  }
  json["margin"] = margin;
  return json;
}

struct FundamentalArguments {
  std::string corners;
  double sigma = 0;
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
  FoundCalibration calibration;
};

absl::StatusOr<Found> Find(const FundamentalArguments& arguments) {
  if (arguments.corners.empty() && arguments.sources.cameras.empty()) {
    return InvalidArgument(
        "give --corners, for weak calibration straight from tags, or --cameras, a folder of camera "
        "models");
  }
  Found found{.sightings = {},
              .calibration = {.views = {}, .pairs = {}, .cameras = arguments.sources.cameras}};
  if (!arguments.corners.empty()) {
    ASSIGN_OR_RETURN(found.sightings, ReadSightings(arguments.corners, arguments.sigma));
  }
  ASSIGN_OR_RETURN(found.calibration.views, PairedViews(arguments.sources, found.sightings));
  found.calibration.pairs = FindPairs(found.calibration.views, found.sightings, arguments.settings);
  return found;
}

// What bands are drawn of: the cameras if they are known, else the matrices.
Calibration CalibrationOf(const FoundCalibration& found) {
  Calibration calibration;
  if (!found.cameras.empty()) {
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
  const auto most =
      std::ranges::max_element(seen, {}, [](const auto& frame) { return frame.second; });
  return most == seen.end() ? "" : most->first;
}

absl::StatusOr<std::map<std::string, Picture>> ReadImages(const FundamentalArguments& arguments,
                                                          const FoundCalibration& found) {
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
      const Picture image = ImageOfFile(file, cv::IMREAD_COLOR);
      if (image.empty()) return NotFound("'", file, "' is no image, or is cut off");
      images[view.name] = image;
    }
  }
  if (images.empty() && !arguments.images.empty()) {
    return NotFound("--images has no image of any view; give a folder with VIEW.png, or VIEW=FILE");
  }
  return images;
}

absl::StatusOr<std::vector<std::string>> DrawBands(const FundamentalArguments& arguments,
                                                   const Found& all) {
  const FoundCalibration& found = all.calibration;
  ASSIGN_OR_RETURN(const auto images, ReadImages(arguments, found));
  RETURN_IF_ERROR(MakeFolder(arguments.draw));
  const Calibration calibration = CalibrationOf(found);
  // An image shows one frame.
  const bool any_frame = arguments.images.empty() || !arguments.frame.empty();
  const std::string frame = any_frame ? arguments.frame : BestFrame(all.sightings);
  std::vector<std::string> written;
  for (const PairResult& pair : found.pairs) {
    if (pair.f.norm() == 0) continue;
    const BandPictures pictures{.views = found.views,
                                .calibration = calibration,
                                .margin = found.cameras.empty() ? pair.margin : 0,
                                .sightings = all.sightings,
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

// FailedPrecondition if fixed tags contradict the cameras. Warns of views that they cannot test.
absl::Status GuardCameras(const FoundCalibration& found, std::span<const TagSighting> fixed) {
  ASSIGN_OR_RETURN(const auto alone, CompareWithCameras(found, fixed));
  for (const std::string& view : alone) {
    std::cerr << "silhouette-calibrate: view '" << view
              << "' shares no fixed tag with another, so that it is unknown whether its camera "
                 "moved since it was calibrated"
              << std::endl;
  }
  return absl::OkStatus();
}

// calibration.yaml; what an earlier one says of the same cameras stays.
absl::Status WriteRecord(const FundamentalArguments& arguments, const FoundCalibration& found) {
  ASSIGN_OR_RETURN(auto record, RecordOfFile(found, arguments.calibration));
  if (!record) {
    record.emplace();
    record->set_program(absl::StrCat("silhouette-calibrate fundamental, ",
                                     found.cameras.empty() ? "weak calibration" : "camera models"));
  }
  if (!arguments.fixed_tags.empty()) {
    ASSIGN_OR_RETURN(const auto fixed, ReadSightings(arguments.fixed_tags));
    RETURN_IF_ERROR(SetFixedTags(found, fixed, *record));
    if (!found.cameras.empty()) RETURN_IF_ERROR(GuardCameras(found, fixed));
  }
  return WriteCalibrationFile(found, *std::move(record), arguments.calibration);
}

absl::StatusOr<ExitCode> FundamentalWork(const FundamentalArguments& arguments) {
  ASSIGN_OR_RETURN(const Found all, Find(arguments));
  const FoundCalibration& found = all.calibration;
  const bool of_models = !found.cameras.empty();
  std::vector<std::string> written;
  if (!arguments.draw.empty()) {
    ASSIGN_OR_RETURN(written, DrawBands(arguments, all));
  }
  const bool any_refused = std::ranges::any_of(
      found.pairs, [](const PairResult& pair) { return pair.refusal.has_value(); });
  const bool refused = any_refused && !arguments.skip_refused;
  if (!arguments.out.empty() && !refused) {
    RETURN_IF_ERROR(WriteMatrices(found, arguments.out));
    written.push_back(arguments.out);
  }
  if (!arguments.calibration.empty() && (!refused || of_models)) {
    RETURN_IF_ERROR(WriteRecord(arguments, found));
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
  AddSigmaOption(*command, a.sigma);
  command->add_option("--cameras", a.sources.cameras, "Folder of camera models, VIEW.cameramodel");
  command->add_option("--cell", a.sources.cell,
                      "The cell file: names of the views, sizes of images and masks");
  command
      ->add_option("--image-size", a.sources.image_size,
                   "WIDTHxHEIGHT of all views' camera images; default: as --cell, --cameras or "
                   "--corners state it")
      ->check(SizeInPixels());
  command
      ->add_option("--mask-size", a.sources.mask_size,
                   "WIDTHxHEIGHT of all views' masks, without --cell")
      ->check(SizeInPixels());
  command->add_option("--out", a.out, "YAML file of matrices for silhouette-db calibration import");
  command->add_option(
      "--calibration", a.calibration,
      "calibration.yaml to write for silhouette-db calibration import: the cameras, "
      "else the matrices, with their figures of merit. Entries of an existing file about these "
      "cameras are kept");
  command
      ->add_option("--fixed-tags", a.fixed_tags,
                   "Corners (CSV) of tags that stay in the cell, for --calibration; 'check' "
                   "uses them to see whether a camera moved. Refused if those that two views see "
                   "contradict --cameras")
      ->needs("--calibration");
  command
      ->add_option("--max-margin", a.settings.most_margin,
                   "Margin in mask pixels that a matrix may need: 'calibration.margin' of the "
                   "server's cell file")
      ->check(NumberFromZero())
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
