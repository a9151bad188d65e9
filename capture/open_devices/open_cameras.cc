#include "capture/open_devices/open_cameras.h"

#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"

namespace silhouette {

absl::Status CheckCameras(const Cell& cell) {
  for (const ViewSettings& view : cell.views) {
    if (view.source.empty()) {
      return CellMistake(cell,
                         absl::StrCat("the view '", view.name,
                                      "' has no source of images; put 'source: sim' into it"));
    }
    if (view.source != kSimulated) {
      return CellMistake(cell, absl::StrCat("the view '", view.name, "' has the source '",
                                            view.source, "', which is not known; known is 'sim'"));
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<std::unique_ptr<CameraRig>> OpenCameras(const Cell& cell,
                                                       std::shared_ptr<SimulatedCell> simulation) {
  if (absl::Status status = CheckCameras(cell); !status.ok()) return status;
  std::vector<SimulatedView> views;
  for (const ViewSettings& view : cell.views) {
    views.push_back({view.name, view.image_width, view.image_height});
  }
  auto rig = SimulatedCameraRig::Create(std::move(simulation), views);
  if (!rig.ok()) return rig.status();
  return std::unique_ptr<CameraRig>(*std::move(rig));
}

}  // namespace silhouette
