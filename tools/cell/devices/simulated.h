// The simulated cell of a cell's file, for devices that are simulated in process.
#pragma once

#include <memory>

#include "absl/status/statusor.h"
#include "capture/sim/simulated_cell.h"
#include "tools/cell/cell.h"

namespace silhouette {

bool HasSimulatedRobot(const Cell& cell);
bool HasSimulatedCamera(const Cell& cell);

// With the robot as it is in a variant. InvalidArgument, saying what to put where, if
// the file names no simulation or no model of the robot, or if one of them cannot be read.
absl::StatusOr<std::shared_ptr<SimulatedCell>> LoadSimulatedCell(
    const Cell& cell, const std::string& variant = kBareVariant);

// InvalidArgument with the cell's file in front.
absl::Status CellMistake(const Cell& cell, const std::string& what);

}  // namespace silhouette
