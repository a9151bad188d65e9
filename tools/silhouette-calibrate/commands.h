// SPDX-License-Identifier: Apache-2.0
// The commands of silhouette-calibrate. Each adds itself to the program and sets `run` when it is
// chosen.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

#include "absl/status/statusor.h"
#include "tools/program/program.h"

namespace silhouette {

// What a chosen command does; an error is reported and becomes the exit code (ExitCodeOf).
using Run = Work;

void AddBoardCommand(CLI::App& program, Run& run);
void AddDetectCommand(CLI::App& program, Run& run);
void AddIntrinsicsCommand(CLI::App& program, Run& run);
void AddPosesCommand(CLI::App& program, Run& run);
void AddFundamentalCommand(CLI::App& program, Run& run);
void AddCheckCommand(CLI::App& program, Run& run);
void AddRunCommand(CLI::App& program, Run& run);
void AddReportCommand(CLI::App& program, Run& run);

}  // namespace silhouette
