// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-sim/serve.h"

#include <utility>

#include "capture/sim/served/network_cameras.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

// The port in "127.0.0.1:8554" or "rtsp://127.0.0.1:8554/top".
int PortOf(const std::string& place) { return std::stoi(place.substr(place.rfind(':') + 1)); }

}  // namespace

absl::StatusOr<ServedCameras> ServeCameras(const Workplace& workplace, const std::string& kind,
                                           int port,
                                           const std::shared_ptr<SimulatedCell>& simulation) {
  std::vector<SimulatedView> shown;
  for (const ViewSettings& view : workplace.cell.views) {
    shown.push_back({view.name, view.image_width, view.image_height});
  }
  ASSIGN_OR_RETURN(auto views, ServedViews::Create(simulation, shown));
  const auto start = [kind, &views = *views](int at) {
    if (kind == "gige") return ServeGigeCameras(views);
    return kind == "rtsp" ? ServeRtspCameras(views, at) : ServeGrpcCameras(views, at);
  };
  ServedCameras cameras;
  ASSIGN_OR_RETURN(cameras.server, start(port));
  const std::vector<std::string>& addresses = cameras.server->addresses();
  for (size_t v = 0; v < shown.size(); ++v) {
    nlohmann::ordered_json view{{"view", shown[v].name}};
    if (kind == "gige") view["serial"] = shown[v].name;
    view[kind == "rtsp" ? "url" : "address"] = addresses[v];
    cameras.told.push_back(std::move(view));
  }
  const int bound = kind == "gige" ? 0 : PortOf(addresses[0]);
  cameras.start = [start, bound] { return start(bound); };
  cameras.loses_packets = kind == "gige";
  cameras.views = std::move(views);
  return cameras;
}

}  // namespace silhouette
