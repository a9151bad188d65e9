// The views that `silhouette-calibrate fundamental` works on: their names, sizes, and cameras where
// these are known.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/boards/tag_sighting.h"
#include "calib/camera/camera_model.h"
#include "calib/fundamental/line_distances.h"

namespace silhouette {

struct PairedView {
  std::string name;
  ViewSizes sizes;
  std::optional<CameraModel> camera;
};

// Where views come from; what is empty is not given.
struct ViewSources {
  std::string cell;     // cell.yaml: names and sizes
  std::string cameras;  // folder of .cameramodel files
  std::string image_size;
  std::string mask_size;
};

// "640x480"; InvalidArgument, naming `option`, if it is not so.
absl::StatusOr<PixelSize> SizeFromText(const std::string& text, const std::string& option);

// In the order of the cell, else of the cameras' files, else of the sightings. InvalidArgument or
// NotFound in a sentence: a size that nobody tells, a camera that is missing or for another size, a
// sighting of a view that is not there or beyond its image, less than two views.
absl::StatusOr<std::vector<PairedView>> PairedViews(const ViewSources& sources,
                                                    std::span<const TagSighting> sightings);

}  // namespace silhouette
