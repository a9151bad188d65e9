// The cameras of `silhouette-sim serve`.
#pragma once

#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "capture/sim/served/served_views.h"
#include "capture/sim/simulated_cell.h"
#include "tools/silhouette-sim/workplace.h"

namespace silhouette {

// What --cameras takes.
inline const std::vector<std::string> kCameraKinds = {"gige", "grpc", "rtsp"};

// The views of a cell as cameras on the network, until it goes.
struct ServedCameras {
  std::unique_ptr<ServedViews> views;
  std::shared_ptr<void> server;  // ends before the views
  // Makes the server anew, where it was.
  std::function<absl::StatusOr<std::shared_ptr<void>>()> start;
  // Lets `server` lose packets (GigeCameras::LosePackets); null but for gige.
  void (*lose_packets)(void* server, double share) = nullptr;
  nlohmann::ordered_json told = nlohmann::ordered_json::array();  // where they are
};

// All views of the cell's file, whatever it says of their sources; `kind` of kCameraKinds. Port: of
// rtsp and grpc; 0: a free one. Errors: those of the servers of capture/sim/served.
absl::StatusOr<ServedCameras> ServeCameras(const Workplace& workplace, const std::string& kind,
                                           int port,
                                           const std::shared_ptr<SimulatedCell>& simulation);

}  // namespace silhouette
