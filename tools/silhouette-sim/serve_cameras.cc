// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-sim/serve.h"

#include <utility>

#include "capture/sim/served/network_cameras.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

using Told = nlohmann::ordered_json;

template <typename Server>
using Started = absl::StatusOr<std::unique_ptr<Server>>;

// Keeps the server and says of each view what `tell` says. `again`: makes it anew, where it was.
template <typename Server, typename Tell, typename Again>
absl::Status Keep(Started<Server> started, ServedCameras& cameras, const Tell& tell,
                  const Again& again) {
  if (!started.ok()) return started.status();
  const std::shared_ptr<Server> server = *std::move(started);
  for (size_t v = 0; v < cameras.views->views().size(); ++v) {
    Told view{{"view", cameras.views->views()[v].name}};
    tell(*server, v, view);
    cameras.told.push_back(std::move(view));
  }
  cameras.start = [again]() -> absl::StatusOr<std::shared_ptr<void>> {
    Started<Server> made = again();
    if (!made.ok()) return made.status();
    return std::shared_ptr<void>(*std::move(made));
  };
  cameras.server = server;
  return absl::OkStatus();
}

// The port in "127.0.0.1:8554" or "rtsp://127.0.0.1:8554/top".
int PortOf(const std::string& place) { return std::stoi(place.substr(place.rfind(':') + 1)); }

absl::Status StartGige(ServedCameras& cameras) {
  ServedViews& views = *cameras.views;
  cameras.lose_packets = [](void* server, double share) {
    static_cast<GigeCameras*>(server)->LosePackets(share);
  };
  return Keep(
      GigeCameras::Start(views), cameras,
      [&](const GigeCameras& server, size_t v, Told& told) {
        told["serial"] = views.views()[v].name;
        told["address"] = server.addresses()[v];
      },
      [&views] { return GigeCameras::Start(views); });
}

absl::Status Start(const std::string& kind, int port, ServedCameras& cameras) {
  ServedViews& views = *cameras.views;
  if (kind == "gige") return StartGige(cameras);
  const auto at = std::make_shared<int>(port);
  if (kind == "rtsp") {
    return Keep(
        RtspCameras::Start(views, port), cameras,
        [at](const RtspCameras& server, size_t v, Told& told) {
          told["url"] = server.urls()[v];
          *at = PortOf(server.urls()[v]);
        },
        [&views, at] { return RtspCameras::Start(views, *at); });
  }
  return Keep(
      GrpcCameras::Start(views, port), cameras,
      [at](const GrpcCameras& server, size_t, Told& told) {
        told["address"] = server.address();
        *at = PortOf(server.address());
      },
      [&views, at] { return GrpcCameras::Start(views, *at); });
}

}  // namespace

absl::StatusOr<ServedCameras> ServeCameras(const Workplace& workplace, const std::string& kind,
                                           int port,
                                           const std::shared_ptr<SimulatedCell>& simulation) {
  std::vector<SimulatedView> shown;
  for (const ViewSettings& view : workplace.cell.views) {
    shown.push_back({view.name, view.image_width, view.image_height});
  }
  ASSIGN_OR_RETURN(auto views, ServedViews::Create(simulation, shown));
  ServedCameras cameras;
  cameras.views = std::move(views);
  RETURN_IF_ERROR(Start(kind, port, cameras));
  return cameras;
}

}  // namespace silhouette
