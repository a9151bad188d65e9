// The commands of silhouette-calibrate. Each adds itself to the program and sets `run` when it is
// chosen.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

namespace silhouette {

using Run = std::function<int()>;

void AddBoardCommand(CLI::App& program, Run& run);
void AddDetectCommand(CLI::App& program, Run& run);
void AddIntrinsicsCommand(CLI::App& program, Run& run);
void AddPosesCommand(CLI::App& program, Run& run);
void AddFundamentalCommand(CLI::App& program, Run& run);
void AddCheckCommand(CLI::App& program, Run& run);
void AddRunCommand(CLI::App& program, Run& run);
void AddReportCommand(CLI::App& program, Run& run);

}  // namespace silhouette
