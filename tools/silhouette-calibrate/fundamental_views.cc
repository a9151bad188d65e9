// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-calibrate/fundamental_views.h"

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "calib/files/camera_file.h"
#include "calib/fundamental/correspondences.h"
#include "db/status/status_macros.h"
#include "tools/cell/cell.h"
#include "tools/silhouette-calibrate/files.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;

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

std::string Text(PixelSize size) { return absl::StrCat(size.width, "x", size.height); }

bool Same(PixelSize one, PixelSize other) {
  return one.width == other.width && one.height == other.height;
}

absl::Status TakeCamera(const std::string& folder, PairedView& view) {
  const std::string file = (fs::path(folder) / CameraFileName(view.name)).string();
  ASSIGN_OR_RETURN(CameraModel camera, ReadCameraFile(file));
  const PixelSize size{camera.intrinsics().width, camera.intrinsics().height};
  if (view.sizes.image.width > 0 && !Same(view.sizes.image, size)) {
    return absl::InvalidArgumentError(absl::StrCat("'", file, "' is for images of ", Text(size),
                                                   ", but those of view '", view.name, "' are ",
                                                   Text(view.sizes.image)));
  }
  view.sizes.image = size;
  view.camera = std::move(camera);
  return absl::OkStatus();
}

absl::Status CheckSightings(const std::vector<PairedView>& views,
                            std::span<const TagSighting> sightings) {
  for (const TagSighting& sighting : sightings) {
    const auto view = std::find_if(views.begin(), views.end(), [&](const PairedView& each) {
      return each.name == sighting.view;
    });
    if (view == views.end()) {
      return absl::InvalidArgumentError(absl::StrCat(
          "the corners are of a view '", sighting.view, "' that is not there; the views are ",
          absl::StrJoin(views, ", ", [](std::string* out, const PairedView& each) {
            absl::StrAppend(out, each.name);
          })));
    }
    const PixelSize image = view->sizes.image;
    for (const Eigen::Vector2d& corner : sighting.corners) {
      if (corner.x() >= -0.5 && corner.x() <= image.width - 0.5 && corner.y() >= -0.5 &&
          corner.y() <= image.height - 0.5) {
        continue;
      }
      return absl::InvalidArgumentError(absl::StrCat(
          "frame '", sighting.frame, "', view '", sighting.view, "', tag ", sighting.tag,
          ": a corner at (", corner.x(), ", ", corner.y(), ") is not in an image of ", Text(image),
          "; the images' size is wrong, or sizes are mixed"));
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

}  // namespace

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
      return absl::InvalidArgumentError(absl::StrCat("how large the images of view '", view.name,
                                                     "' are is not said; give --cell, "
                                                     "--image-size or --cameras"));
    }
    if (view.sizes.mask.width <= 0) {
      return absl::InvalidArgumentError(absl::StrCat("how large the masks of view '", view.name,
                                                     "' are is not said; give --cell or "
                                                     "--mask-size"));
    }
  }
  if (views->size() < 2) {
    return absl::InvalidArgumentError("there must be at least two views to pair");
  }
  RETURN_IF_ERROR(CheckSightings(*views, sightings));
  return views;
}

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

}  // namespace silhouette
