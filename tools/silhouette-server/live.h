// SPDX-License-Identifier: Apache-2.0
// The acquisition of a cell whose images the server takes itself.
#pragma once

#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "server/live/live_loop.h"
#include "server/live/live_record.h"
#include "server/service/server.h"
#include "tools/cell/cell.h"

namespace silhouette {

std::shared_ptr<LiveRecord> NewLiveRecord(const Cell& cell);

// Opens the devices that the cell's file names and publishes scenes to `server`, which must outlive
// it. `obstacles`: a file of the obstacles in a simulated cell; empty: none. Errors: those of
// OpenersOf and LiveLoop::Start.
absl::StatusOr<std::unique_ptr<LiveLoop>> StartLive(const Cell& cell, const std::string& obstacles,
                                                    std::shared_ptr<LiveRecord> record,
                                                    Server& server);

}  // namespace silhouette
