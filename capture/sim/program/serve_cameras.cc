#include "capture/sim/program/serve_cameras.h"

#include <utility>

#include "capture/sim/served/gige_cameras.h"
#include "capture/sim/served/grpc_cameras.h"
#include "capture/sim/served/rtsp_cameras.h"

namespace silhouette {
namespace {

using Told = nlohmann::ordered_json;

// Keeps the server and says of each view what `tell` says.
template <typename Server, typename Tell>
absl::Status Keep(absl::StatusOr<std::unique_ptr<Server>> started, ServedCameras& cameras,
                  const Tell& tell) {
  if (!started.ok()) return started.status();
  const std::shared_ptr<Server> server = *std::move(started);
  for (size_t v = 0; v < cameras.views->views().size(); ++v) {
    Told view{{"view", cameras.views->views()[v].name}};
    tell(*server, v, view);
    cameras.told.push_back(std::move(view));
  }
  cameras.server = server;
  return absl::OkStatus();
}

absl::Status Start(const std::string& kind, int port, ServedCameras& cameras) {
  ServedViews& views = *cameras.views;
  if (kind == "gige") {
    return Keep(GigeCameras::Start(views), cameras,
                [&](const GigeCameras& server, size_t v, Told& told) {
                  told["serial"] = views.views()[v].name;
                  told["address"] = server.addresses()[v];
                });
  }
  if (kind == "rtsp") {
    return Keep(
        RtspCameras::Start(views, port), cameras,
        [](const RtspCameras& server, size_t v, Told& told) { told["url"] = server.urls()[v]; });
  }
  return Keep(
      GrpcCameras::Start(views, port), cameras,
      [](const GrpcCameras& server, size_t, Told& told) { told["address"] = server.address(); });
}

}  // namespace

absl::StatusOr<ServedCameras> ServeCameras(const Workplace& workplace, const std::string& kind,
                                           int port,
                                           const std::shared_ptr<SimulatedCell>& simulation) {
  std::vector<SimulatedView> shown;
  for (const ViewSettings& view : workplace.cell.views) {
    shown.push_back({view.name, view.image_width, view.image_height});
  }
  auto views = ServedViews::Create(simulation, shown);
  if (!views.ok()) return views.status();
  ServedCameras cameras{.views = *std::move(views), .server = nullptr, .told = Told::array()};
  if (absl::Status status = Start(kind, port, cameras); !status.ok()) return status;
  return cameras;
}

}  // namespace silhouette
