#include "tools/silhouette-calibrate/fundamental_views.h"

#include <algorithm>
#include <cctype>
#include <cstdio>
#include <filesystem>
#include <system_error>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "calib/files/calibration_camera_file.h"
#include "calib/files/calibration_message.h"
#include "calib/fundamental/correspondences.h"
#include "common/picture/files.h"
#include "db/status/status_macros.h"
#include "tools/cell/cell.h"
#include "tools/silhouette-calibrate/camera_files.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;

absl::StatusOr<std::vector<std::string>> NamesOfCameras(const std::string& folder) {
  std::vector<std::string> names;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    if (entry.path().extension() == kCameraFileExtension)
      names.push_back(ViewOfCameraFile(entry.path().string()));
  }
  if (error) {
    return absl::NotFoundError(
        absl::StrCat("the folder '", folder, "' cannot be read: ", error.message()));
  }
  std::sort(names.begin(), names.end());
  return names;
}

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
  absl::StatusOr<std::vector<std::string>> names = ViewsOf(sightings);
  if (!sources.cameras.empty()) names = NamesOfCameras(sources.cameras);
  if (!names.ok()) return names.status();
  for (const std::string& name : *names) views.push_back({.name = name, .sizes = {}, .camera = {}});
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

}  // namespace

absl::StatusOr<PixelSize> SizeFromText(const std::string& text, const std::string& option) {
  const std::vector<std::string> parts = absl::StrSplit(text, 'x');
  PixelSize size;
  if (parts.size() == 2 && absl::SimpleAtoi(parts[0], &size.width) &&
      absl::SimpleAtoi(parts[1], &size.height) && size.width > 0 && size.height > 0) {
    return size;
  }
  return absl::InvalidArgumentError(
      absl::StrCat(option, " '", text, "' is not WIDTHxHEIGHT in pixels, e.g. 640x480"));
}

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

}  // namespace silhouette
