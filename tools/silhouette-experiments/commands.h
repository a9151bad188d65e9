// The commands of silhouette-experiments. Each adds itself to the program and sets `run` when it is
// chosen.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

namespace silhouette {

using Run = std::function<int()>;

void AddHiddenCommand(CLI::App& program, Run& run);
void AddPaperCommand(CLI::App& program, Run& run);
void AddCellCommand(CLI::App& program, Run& run);
void AddCalibrationCommand(CLI::App& program, Run& run);
void AddPlacementCommand(CLI::App& program, Run& run);
void AddSegmentationCommand(CLI::App& program, Run& run);

}  // namespace silhouette
