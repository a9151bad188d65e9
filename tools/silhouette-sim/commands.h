// SPDX-License-Identifier: Apache-2.0
// The commands of silhouette-sim. Each adds itself to the program and sets `run` when it is chosen.
#pragma once

#include <CLI/CLI.hpp>

#include "tools/program/program.h"

namespace silhouette {

using Run = Work;

void AddRenderCommand(CLI::App& program, Run& run);
void AddContactCommand(CLI::App& program, Run& run);
void AddServeCommand(CLI::App& program, Run& run);
void AddTruthCommand(CLI::App& program, Run& run);
void AddPathCommand(CLI::App& program, Run& run);
void AddCalibrationCommand(CLI::App& program, Run& run);

}  // namespace silhouette
