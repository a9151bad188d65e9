// SPDX-License-Identifier: Apache-2.0
// silhouette-db merge: unites the shards of a drawing.
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/result/result.h"
#include "db/status/status_macros.h"
#include "db/store/shards.h"
#include "tools/program/progress.h"
#include "tools/silhouette-db/commands.h"
#include "tools/silhouette-db/common.h"

namespace silhouette {
namespace {

struct MergeOptions {
  std::vector<std::string> shards;
  std::string into;
  std::string format = "text";
};

absl::StatusOr<ExitCode> Merge(const MergeOptions& options) {
  CatchStopSignals();
  std::optional<Progress> progress;
  const auto report = MergeShards(
      options.shards, options.into,
      {.program = "silhouette-db merge", .progress = [&](uint64_t done, uint64_t tiles) {
         if (!progress) progress.emplace("merge", tiles, "tiles");
         progress->Update(done);
         return !StopRequested();
       }});
  progress.reset();
  if (!report.ok()) return report.status();
  const nlohmann::ordered_json json = {{"database", options.into},
                                       {"shards", report->shards},
                                       {"tiles", report->tiles},
                                       {"records", report->records},
                                       {"bytes", report->bytes}};
  PrintResult(options.format, json,
              absl::StrFormat("shards             %d\n"
                              "tiles              %d\n"
                              "robot images       %d, %s with their collision index\n"
                              "database           %s\n",
                              report->shards, report->tiles, report->records, MiB(report->bytes),
                              options.into));
  return kDone;
}

}  // namespace

void AddMerge(CLI::App& app, Work& work) {
  auto [command, options] =
      AddCommand(app, work, "merge",
                 "Unites the shards of a drawing (silhouette-capture draw --shard) in a new "
                 "database",
                 Merge);
  command.add_option("shards", options.shards, "Folders of all shards, in any order")->required();
  command.add_option("--into", options.into, "New folder for the whole")->required();
  AddFormatOption(command, options.format);
  command.footer(
      "Nothing is in the new folder until all is. The shards stay.\n"
      "Example:\n  silhouette-db merge shards/*.lmdb --into cell.lmdb");
}

}  // namespace silhouette
