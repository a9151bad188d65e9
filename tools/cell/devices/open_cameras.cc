// SPDX-License-Identifier: Apache-2.0
#include "tools/cell/devices/open_devices.h"

#include <algorithm>
#include <map>
#include <utility>
#include <variant>
#include <vector>

#include "absl/strings/str_cat.h"
#include "capture/devices/camera_set.h"
#include "capture/drivers/aravis/aravis_camera.h"
#include "capture/drivers/grpc/grpc_camera.h"
#include "capture/drivers/opencv/opencv_camera.h"
#include "capture/drivers/opencv/rtsp_round_trip.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

// The simulated cameras among others.
class SimulatedCameras : public CameraSource {
 public:
  explicit SimulatedCameras(std::unique_ptr<CameraRig> rig) : rig_(std::move(rig)) {}

  const std::vector<std::string>& views() const override { return rig_->views(); }
  absl::Duration timeout() const override { return absl::InfiniteDuration(); }
  absl::Status Trigger() override { return absl::OkStatus(); }
  absl::StatusOr<EachImage> Wait(absl::Duration) override { return rig_->GrabEach(); }

 private:
  const std::unique_ptr<CameraRig> rig_;
};

absl::StatusOr<std::unique_ptr<CameraRig>> OpenSimulated(
    const Cell& cell, std::shared_ptr<SimulatedCell> simulation) {
  std::vector<SimulatedView> views;
  for (const ViewSettings& view : cell.views) {
    if (IsSimulated(view.source)) views.push_back({view.name, view.image_width, view.image_height});
  }
  ASSIGN_OR_RETURN(auto rig, SimulatedCameraRig::Create(std::move(simulation), views));
  return std::unique_ptr<CameraRig>(std::move(rig));
}

using OpenedSource = absl::StatusOr<std::unique_ptr<CameraSource>>;

// Opens the source of one view; null: one that views share.
struct SourceOpener {
  const ViewSettings& view;

  OpenedSource operator()(const GenicamSource& source) const {
    return OpenGenicamCamera(view.name, view.image_width, view.image_height, source);
  }
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
  OpenedSource operator()(const GrpcSource&) const { return nullptr; }
  OpenedSource operator()(const SimulatedSource&) const { return nullptr; }
  OpenedSource operator()(const std::monostate&) const { return nullptr; }
};

// What only one view can have, as text for messages; empty: nothing.
struct OwnDevice {
  std::string operator()(const GenicamSource& source) const {
    return source.serial + source.address;
  }
  std::string operator()(const V4l2Source& source) const { return source.device; }
  std::string operator()(const RtspSource& source) const { return WithoutPassword(source.url); }
  std::string operator()(const GrpcSource& source) const {
    return absl::StrCat("'", source.camera, "' of the driver at ", source.address);
  }
  template <typename Other>
  std::string operator()(const Other&) const {
    return "";
  }
};

// The camera drivers of the cell, each with all of its views. `errors`: as OpenCameras.
absl::Status OpenDrivers(const Cell& cell, std::vector<std::unique_ptr<CameraSource>>& sources,
                         CameraErrors* errors) {
  struct Driver {
    std::vector<GrpcView> views;
    absl::Duration timeout;
    ClientTlsFiles tls;
  };
  std::map<std::string, Driver> drivers;  // by address
  for (const ViewSettings& view : cell.views) {
    const auto* source = std::get_if<GrpcSource>(&view.source);
    if (source == nullptr) continue;
    Driver& driver = drivers[source->address];
    if (!driver.views.empty() && !(driver.tls == source->tls)) {
      return absl::InvalidArgumentError(
          absl::StrCat("the views of the camera driver at ", source->address,
                       " have different 'tls'; one call takes them all: state the same for all"));
    }
    driver.tls = source->tls;
    driver.views.push_back({view.name, source->camera, view.image_width, view.image_height});
    driver.timeout = std::max(driver.timeout, source->timeout);
  }
  for (const auto& [address, driver] : drivers) {
    OpenedSource opened = OpenGrpcCameras(address, driver.views, driver.timeout, driver.tls);
    if (opened.ok()) {
      sources.push_back(*std::move(opened));
      continue;
    }
    if (errors == nullptr) return opened.status();
    for (const GrpcView& view : driver.views) errors->emplace(view.view, opened.status());
  }
  return absl::OkStatus();
}

absl::Status OfView(const ViewSettings& view, const absl::Status& status) {
  return absl::Status(status.code(),
                      absl::StrCat("the camera of the view '", view.name, "': ", status.message()));
}

}  // namespace

absl::Status CheckCameras(const Cell& cell) {
  std::map<std::string, std::string> views;  // by the device that is theirs
  for (const ViewSettings& view : cell.views) {
    if (!HasImages(view.source)) {
      return CellMistake(cell, absl::StrCat("the view '", view.name,
                                            "' has no source of images; put 'source: sim' into it, "
                                            "or what its camera is (docs/cell.yaml)"));
    }
    const std::string device = std::visit(OwnDevice(), view.source);
    const auto [other, is_new] = views.emplace(device, view.name);
    if (is_new || device.empty()) continue;
    return CellMistake(cell, absl::StrCat("the views '", other->second, "' and '", view.name,
                                          "' have the same camera, ", device));
  }
  return absl::OkStatus();
}

absl::StatusOr<std::unique_ptr<CameraSet>> OpenCameras(const Cell& cell,
                                                       std::shared_ptr<SimulatedCell> simulation,
                                                       CameraErrors* errors) {
  RETURN_IF_ERROR(CheckCameras(cell));
  std::vector<std::unique_ptr<CameraSource>> sources;
  if (HasSimulatedCamera(cell)) {
    ASSIGN_OR_RETURN(auto simulated, OpenSimulated(cell, std::move(simulation)));
    sources.push_back(std::make_unique<SimulatedCameras>(std::move(simulated)));
  }
  RETURN_IF_ERROR(OpenDrivers(cell, sources, errors));
  std::vector<std::string> views;
  for (const ViewSettings& view : cell.views) {
    OpenedSource source = std::visit(SourceOpener{view}, view.source);
    if (!source.ok()) {
      if (errors == nullptr) return OfView(view, source.status());
      errors->emplace(view.name, source.status());
    } else if (*source != nullptr) {
      sources.push_back(*std::move(source));
    }
    if (errors == nullptr || !errors->contains(view.name)) views.push_back(view.name);
  }
  return std::make_unique<CameraSet>(std::move(views), std::move(sources));
}

}  // namespace silhouette
