// SPDX-License-Identifier: Apache-2.0
// silhouette-db index: builds the collision index.
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "absl/strings/str_format.h"
#include "absl/time/clock.h"
#include "common/numbers/numbers.h"
#include "common/result/result.h"
#include "db/status/status_macros.h"
#include "db/store/collision_index.h"
#include "tools/program/for_shell.h"
#include "tools/program/progress.h"
#include "tools/silhouette-db/commands.h"
#include "tools/silhouette-db/common.h"

namespace silhouette {
namespace {

struct IndexOptions : DatabaseOptions {
  IndexOptions() { variant.clear(); }  // all variants
  bool all = false;
};

absl::StatusOr<IndexBuildReport> BuildWithProgress(Database& database,
                                                   const IndexOptions& options) {
  std::optional<Progress> progress;
  const auto update = [&](uint64_t done, uint64_t tiles) {
    if (!progress) progress.emplace("collision index", tiles, "tiles");
    progress->Update(done);
    return !StopRequested();
  };
  return BuildCollisionIndex(
      database, {.all = options.all, .only_variant = !options.variant.empty(), .progress = update});
}

void PrintReport(const IndexOptions& options, const IndexBuildReport& report,
                 absl::Duration spent) {
  const uint64_t fresh = report.done - report.built - report.removed;
  const double percent = Percent(report.bytes, report.mask_bytes);
  std::string text = absl::StrFormat(
      "tiles              %d built, %d fresh already%s, in %s\n", report.built, fresh,
      report.removed > 0 ? absl::StrFormat(", %d without records removed", report.removed) : "",
      Spoken(spent));
  if (report.robot_images > 0) {
    absl::StrAppendFormat(&text,
                          "of robot images    %d\n"
                          "size               %s, %.1f %% of their masks\n",
                          report.robot_images, MiB(report.bytes), percent);
  }
  if (report.unreadable > 0) {
    absl::StrAppendFormat(
        &text,
        "left out           %d records that cannot be read; name them with: silhouette-db verify "
        "%s\n",
        report.unreadable, ForShell(options.database));
  }
  PrintResult(options.format,
              {{"complete", !report.stopped},
               {"tiles", report.tiles},
               {"built", report.built},
               {"fresh_already", fresh},
               {"removed", report.removed},
               {"robot_images", report.robot_images},
               {"unreadable", report.unreadable},
               {"bytes", report.bytes},
               {"mask_bytes", report.mask_bytes},
               {"share_of_masks", percent / 100},
               {"seconds", absl::ToDoubleSeconds(spent)}},
              text);
}

absl::StatusOr<ExitCode> Index(const IndexOptions& options) {
  ASSIGN_OR_RETURN(std::unique_ptr<Database> database,
                   Database::Open(options.database, Database::Access::kWrite));
  if (!options.variant.empty()) {
    ASSIGN_OR_RETURN(database, database->OpenVariant(options.variant));
  }
  CatchStopSignals();
  const absl::Time started = absl::Now();
  ASSIGN_OR_RETURN(const auto report, BuildWithProgress(*database, options));
  PrintReport(options, report, absl::Now() - started);
  if (!report.stopped) return kDone;
  std::cout << std::flush;
  std::cerr << "stopped, " << report.tiles - report.done
            << " tiles are left; what is built stays; go on with: silhouette-db index "
            << ForShell(options.database)
            << (options.variant.empty() ? "" : " --variant " + options.variant)
            << (options.all ? " --all (begins with the first again)" : "") << std::endl;
  return kNo;
}

}  // namespace

void AddIndex(CLI::App& app, Work& work) {
  auto [command, options] = AddCommand(
      app, work, "index",
      "Builds the collision index, with which the server checks the whole configuration space",
      Index);
  command.add_option("--variant", options.variant, "Only of this variant; default: of all");
  command.add_flag("--all", options.all,
                   "Rebuild fresh tiles, too; by default only tiles whose records have changed");
  AddFormatOption(command, options.format);
  command.footer(
      "silhouette-capture builds it at the end of a capture. After an import or a change of\n"
      "records, run this. Safe to interrupt: run the same command again to resume.\n"
      "Example:\n  silhouette-db index cell.lmdb\n"
      "Exit codes: 0 all is built; 1 stopped; 2 wrong arguments; 3 the disk failed.");
}

}  // namespace silhouette
