// SPDX-License-Identifier: Apache-2.0
// The subcommands of silhouette-db, each in a file of its own.
#pragma once

#include <CLI/CLI.hpp>
#include <memory>
#include <string>
#include <type_traits>
#include <utility>

#include "absl/status/statusor.h"
#include "db/store/schema.h"
#include "tools/program/program.h"

namespace silhouette {

// The options that most subcommands have.
struct DatabaseOptions {
  std::string database;  // its folder
  std::string variant = schema::kDefaultVariant;
  std::string format = "text";
  std::string picture;  // the PNG file to write; empty: none
};

// Adds the subcommand `name` to `parent`; when it is chosen, `work` calls `run` with its options.
// Returns the subcommand and its options, which live as long as it. DatabaseOptions have the
// database's folder as the first argument, or as --database.
template <typename Options>
std::pair<CLI::App&, Options&> AddCommand(CLI::App& parent, Work& work, const std::string& name,
                                          const std::string& description,
                                          absl::StatusOr<ExitCode> (*run)(const Options&)) {
  const auto options = std::make_shared<Options>();
  CLI::App* command = parent.add_subcommand(name, description);
  command->callback([&work, options, run] { work = [options, run] { return run(*options); }; });
  if constexpr (std::is_base_of_v<DatabaseOptions, Options>) {
    command->add_option("database,--database", options->database, "Folder of the database")
        ->required();
  }
  return {*command, *options};
}

// Adds --variant, the variant that a subcommand is about.
void AddVariantOption(CLI::App& command, std::string& variant);

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
void AddMerge(CLI::App& app, Work& work);
void AddCalibration(CLI::App& app, Work& work);
void AddAudit(CLI::App& app, Work& work);

}  // namespace silhouette
