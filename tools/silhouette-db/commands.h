// The subcommands of silhouette-db, each in a file of its own.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

#include "absl/status/statusor.h"
#include "tools/program/program.h"

namespace silhouette {

// What the chosen subcommand does. An error status is told by its message and exit code.
using Work = std::function<absl::StatusOr<ExitCode>()>;

// Each adds its subcommand to `app` and, when it is chosen, sets `work`.
void AddInfo(CLI::App& app, Work& work);
void AddVerify(CLI::App& app, Work& work);
void AddCoverage(CLI::App& app, Work& work);
void AddShow(CLI::App& app, Work& work);
void AddSheet(CLI::App& app, Work& work);
void AddVariants(CLI::App& app, Work& work);
void AddStats(CLI::App& app, Work& work);
void AddExport(CLI::App& app, Work& work);
void AddImport(CLI::App& app, Work& work);
void AddCompact(CLI::App& app, Work& work);
void AddIndex(CLI::App& app, Work& work);
void AddDiff(CLI::App& app, Work& work);
void AddCalibration(CLI::App& app, Work& work);

}  // namespace silhouette
