#include "capture/open_devices/open_cameras.h"

#include <utility>
#include <variant>
#include <vector>

#include "absl/strings/str_cat.h"
#include "capture/drivers/camera_set.h"
#include "capture/drivers/opencv_camera.h"

namespace silhouette {
namespace {

// The simulated cameras among others.
class SimulatedCameras : public CameraSource {
 public:
  explicit SimulatedCameras(std::unique_ptr<CameraRig> rig) : rig_(std::move(rig)) {}

  const std::vector<std::string>& views() const override { return rig_->views(); }
  absl::Duration timeout() const override { return absl::InfiniteDuration(); }
  absl::Status Trigger() override { return absl::OkStatus(); }
  absl::StatusOr<std::vector<CameraImage>> Wait(absl::Time) override { return rig_->Grab(); }

 private:
  const std::unique_ptr<CameraRig> rig_;
};

absl::StatusOr<std::unique_ptr<CameraRig>> OpenSimulated(
    const Cell& cell, std::shared_ptr<SimulatedCell> simulation) {
  std::vector<SimulatedView> views;
  for (const ViewSettings& view : cell.views) {
    if (IsSimulated(view.source)) views.push_back({view.name, view.image_width, view.image_height});
  }
  auto rig = SimulatedCameraRig::Create(std::move(simulation), views);
  if (!rig.ok()) return rig.status();
  return std::unique_ptr<CameraRig>(*std::move(rig));
}

using OpenedSource = absl::StatusOr<std::unique_ptr<CameraSource>>;

// Opens the source of one view; those that several views share are not its business.
struct SourceOpener {
  const ViewSettings& view;

  OpenedSource operator()(const V4l2Source& source) const {
    return OpenV4l2Camera(view.name, view.image_width, view.image_height, source);
  }
  OpenedSource operator()(const RtspSource& source) const {
    return OpenRtspCamera(view.name, source);
  }
  OpenedSource operator()(const VideoSource& source) const { return OpenVideo(view.name, source); }
  OpenedSource operator()(const FolderSource& source) const {
    return OpenFolder(view.name, source);
  }
  OpenedSource operator()(const SimulatedSource&) const { return nullptr; }
  OpenedSource operator()(const std::monostate&) const { return nullptr; }
};

absl::Status OfView(const ViewSettings& view, const absl::Status& status) {
  return absl::Status(status.code(),
                      absl::StrCat("the camera of the view '", view.name, "': ", status.message()));
}

}  // namespace

absl::Status CheckCameras(const Cell& cell) {
  for (const ViewSettings& view : cell.views) {
    if (HasImages(view.source)) continue;
    return CellMistake(cell, absl::StrCat("the view '", view.name,
                                          "' has no source of images; put 'source: sim' into it, "
                                          "or what its camera is (docs/cell.yaml)"));
  }
  return absl::OkStatus();
}

absl::StatusOr<std::unique_ptr<CameraRig>> OpenCameras(const Cell& cell,
                                                       std::shared_ptr<SimulatedCell> simulation) {
  if (absl::Status status = CheckCameras(cell); !status.ok()) return status;
  std::vector<std::unique_ptr<CameraSource>> sources;
  if (HasSimulatedCamera(cell)) {
    auto simulated = OpenSimulated(cell, std::move(simulation));
    if (!simulated.ok()) return simulated.status();
    sources.push_back(std::make_unique<SimulatedCameras>(*std::move(simulated)));
  }
  std::vector<std::string> views;
  for (const ViewSettings& view : cell.views) {
    views.push_back(view.name);
    OpenedSource source = std::visit(SourceOpener{view}, view.source);
    if (!source.ok()) return OfView(view, source.status());
    if (*source != nullptr) sources.push_back(*std::move(source));
  }
  return std::make_unique<CameraSet>(std::move(views), std::move(sources));
}

}  // namespace silhouette
