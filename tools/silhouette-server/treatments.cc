#include "tools/silhouette-server/treatments.h"

#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "capture/segmentation/down_sampling.h"
#include "common/picture/files.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

// A mask pixel proves nothing if any part of its square does not.
absl::StatusOr<Mask> ReadIgnored(const ViewSettings& view) {
  ASSIGN_OR_RETURN(const std::string bytes, ReadWholeFile(view.ignore));
  cv::Mat grey;
  try {
    const std::vector<uint8_t> buffer(bytes.begin(), bytes.end());
    if (!buffer.empty()) grey = cv::imdecode(buffer, cv::IMREAD_GRAYSCALE);
  } catch (const cv::Exception&) {
    grey.release();
  }
  if (grey.empty()) {
    return absl::InvalidArgumentError(absl::StrCat("'", view.ignore, "' is not an image"));
  }
  const cv::Size mask(view.mask_size.width, view.mask_size.height);
  const cv::Size image(view.image_width, view.image_height);
  if (grey.size() != mask && grey.size() != image) {
    return absl::InvalidArgumentError(absl::StrCat(
        "'", view.ignore, "' is ", grey.cols, "x", grey.rows, " pixels large and should be ",
        mask.width, "x", mask.height, ", as the mask, or ", image.width, "x", image.height,
        ", as the camera image"));
  }
  return DownSample(grey, view.mask_size, 0);
}

}  // namespace

absl::StatusOr<TreatmentSettings> TreatmentSettingsOf(const Cell& cell) {
  TreatmentSettings settings;
  bool lengths = false;
  for (const ViewSettings& view : cell.views) {
    ViewTreatmentSettings treatment{.margin = view.margin, .ignored = std::nullopt};
    lengths = lengths || view.margin.metres > 0;
    if (!view.ignore.empty()) {
      absl::StatusOr<Mask> ignored = ReadIgnored(view);
      if (!ignored.ok()) {
        return absl::Status(ignored.status().code(),
                            absl::StrCat(cell.file, ": view '", view.name,
                                         "': ignore: ", ignored.status().message()));
      }
      treatment.ignored = *std::move(ignored);
    }
    settings.views.push_back(std::move(treatment));
  }
  if (!lengths) return settings;
  ASSIGN_OR_RETURN(const Workspace workspace, WorkspaceOf(cell));
  settings.workspace = workspace;
  return settings;
}

}  // namespace silhouette
