// SPDX-License-Identifier: Apache-2.0
// silhouette-db compact: a copy without unused pages.
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "common/result/result.h"
#include "db/status/status_macros.h"
#include "tools/silhouette-db/commands.h"
#include "tools/silhouette-db/common.h"

namespace silhouette {
namespace {

struct CompactOptions : DatabaseOptions {
  std::string target;
};

absl::StatusOr<ExitCode> Compact(const CompactOptions& options) {
  ASSIGN_OR_RETURN(const OpenedDatabase opened, OpenForReading(options.database));
  RETURN_IF_ERROR(opened.database->Compact(options.target));
  ASSIGN_OR_RETURN(const Database::Usage before, opened.database->GetUsage());
  ASSIGN_OR_RETURN(const OpenedDatabase copy, OpenForReading(options.target));
  ASSIGN_OR_RETURN(const Database::Usage after, copy.database->GetUsage());
  const nlohmann::ordered_json json = {{"database", options.database},
                                       {"bytes", before.file_bytes},
                                       {"target", options.target},
                                       {"target_bytes", after.file_bytes}};
  PrintResult(options.format, json,
              absl::StrCat(options.database, ": ", MiB(before.file_bytes), ", ", options.target,
                           ": ", MiB(after.file_bytes), "\n"));
  return kDone;
}

}  // namespace

void AddCompact(CLI::App& app, Work& work) {
  auto [command, options] = AddCommand(
      app, work, "compact", "Copies a database without its unused pages; reads only", Compact);
  command.add_option("target,--target", options.target, "New folder for the copy")->required();
  AddFormatOption(command, options.format);
  command.footer("Example:\n  silhouette-db compact cell.lmdb smaller.lmdb");
}

}  // namespace silhouette
