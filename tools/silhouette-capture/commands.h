// SPDX-License-Identifier: Apache-2.0
// The subcommands of silhouette-capture, each in a file of its own.
#pragma once

#include <CLI/CLI.hpp>

#include "tools/program/program.h"

namespace silhouette {

// Each adds its subcommand to `app` and, when it is chosen, sets `work`.
void AddCameras(CLI::App& app, Work& work);
void AddCheck(CLI::App& app, Work& work);
void AddDraw(CLI::App& app, Work& work);
void AddInit(CLI::App& app, Work& work);
void AddReference(CLI::App& app, Work& work);
void AddRemask(CLI::App& app, Work& work);
void AddReport(CLI::App& app, Work& work);
void AddRun(CLI::App& app, Work& work);
void AddStatus(CLI::App& app, Work& work);
void AddTune(CLI::App& app, Work& work);
void AddVerifyModel(CLI::App& app, Work& work);

}  // namespace silhouette
