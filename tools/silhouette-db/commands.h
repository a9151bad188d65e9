// SPDX-License-Identifier: Apache-2.0
// The subcommands of silhouette-db, each in a file of its own.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <utility>

#include "absl/status/statusor.h"
#include "tools/program/program.h"

namespace silhouette {

// What the chosen subcommand does. An error status becomes a message and an exit code.
using Work = std::function<absl::StatusOr<ExitCode>()>;

// Adds the subcommand `name` to `parent`; when it is chosen, `work` calls `run` with its options.
// Returns the subcommand and its options, which live as long as it.
template <typename Options>
std::pair<CLI::App&, Options&> AddCommand(CLI::App& parent, Work& work, const std::string& name,
                                          const std::string& description,
                                          absl::StatusOr<ExitCode> (*run)(const Options&)) {
  const auto options = std::make_shared<Options>();
  CLI::App* command = parent.add_subcommand(name, description);
  command->callback([&work, options, run] { work = [options, run] { return run(*options); }; });
  return {*command, *options};
}

// Prints a result to stdout in the form that --format asks for.
void Print(const std::string& format, const std::string& text, const nlohmann::json& json);

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
