// SPDX-License-Identifier: Apache-2.0
// silhouette-db compact: a copy without unused pages.
#include <iostream>
#include <memory>

#include "absl/strings/str_format.h"
#include "db/status/status_macros.h"
#include "tools/silhouette-db/commands.h"
#include "tools/silhouette-db/common.h"

namespace silhouette {
namespace {

struct CompactOptions {
  std::string database;
  std::string target;
};

absl::StatusOr<ExitCode> Compact(const CompactOptions& options) {
  ASSIGN_OR_RETURN(const OpenedDatabase opened, OpenForReading(options.database));
  RETURN_IF_ERROR(opened.database->Compact(options.target));
  ASSIGN_OR_RETURN(const Database::Usage before, opened.database->GetUsage());
  ASSIGN_OR_RETURN(const OpenedDatabase copy, OpenForReading(options.target));
  ASSIGN_OR_RETURN(const Database::Usage after, copy.database->GetUsage());
  std::cout << absl::StreamFormat("%s: %.1f MiB, %s: %.1f MiB\n", options.database,
                                  static_cast<double>(before.file_bytes) / (1 << 20),
                                  options.target,
                                  static_cast<double>(after.file_bytes) / (1 << 20));
  return kDone;
}

}  // namespace

void AddCompact(CLI::App& app, Work& work) {
  auto [command, options] = AddCommand(
      app, work, "compact", "Copies a database without its unused pages; reads only", Compact);
  AddDatabaseArgument(command, options.database);
  command.add_option("target,--target", options.target, "New folder for the copy")->required();
  command.footer("Example:\n  silhouette-db compact cell.lmdb smaller.lmdb");
}

}  // namespace silhouette
