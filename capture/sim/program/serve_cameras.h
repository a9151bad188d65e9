// The cameras of `silhouette-sim serve`.
#pragma once

#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "capture/sim/program/workplace.h"
#include "capture/sim/served/served_views.h"
#include "capture/sim/simulated_cell.h"

namespace silhouette {

// What --cameras takes.
inline const std::vector<std::string> kCameraKinds = {"gige", "grpc", "rtsp"};

// The views of a cell as cameras on the network, until it goes.
struct ServedCameras {
  std::unique_ptr<ServedViews> views;
  std::shared_ptr<void> server;  // ends before the views
  nlohmann::ordered_json told;   // where they are
};

// All views of the cell's file, whatever it says of their sources; `kind` of kCameraKinds. Port: of
// rtsp and grpc; 0: a free one. Errors: those of the servers of capture/sim/served.
absl::StatusOr<ServedCameras> ServeCameras(const Workplace& workplace, const std::string& kind,
                                           int port,
                                           const std::shared_ptr<SimulatedCell>& simulation);

}  // namespace silhouette
