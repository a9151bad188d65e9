// SPDX-License-Identifier: Apache-2.0
// silhouette-db index: builds the collision index.
#include <iostream>
#include <memory>
#include <optional>

#include "absl/strings/str_format.h"
#include "absl/time/clock.h"
#include "db/status/status_macros.h"
#include "db/store/collision_index.h"
#include "tools/program/progress.h"
#include "tools/silhouette-db/commands.h"
#include "tools/silhouette-db/common.h"

namespace silhouette {
namespace {

struct IndexOptions {
  std::string database;
  std::string format = "text";
  std::string variant;  // empty: all
  bool all = false;

  std::string Command() const {
    return absl::StrFormat("silhouette-db index %s%s%s", database,
                           variant.empty() ? "" : " --variant " + variant, all ? " --all" : "");
  }
};

absl::StatusOr<IndexBuildReport> BuildWithProgress(Database& database, bool all) {
  std::optional<Progress> progress;
  return BuildCollisionIndex(database, {.all = all, .progress = [&](uint64_t done, uint64_t tiles) {
                                          if (!progress)
                                            progress.emplace("collision index", tiles, "tiles");
                                          progress->Update(done);
                                          return !StopRequested();
                                        }});
}

// Bytes of what was built, as a share of its masks.
double ShareOfMasks(const IndexBuildReport& report) {
  if (report.mask_bytes == 0) return 0;
  return static_cast<double>(report.bytes) / static_cast<double>(report.mask_bytes);
}

std::string TextOf(const IndexOptions& options, const IndexBuildReport& report,
                   absl::Duration spent) {
  std::string text;
  absl::StrAppendFormat(
      &text, "tiles              %d built, %d fresh already%s, in %s\n", report.built,
      report.done - report.built - report.removed,
      report.removed > 0 ? absl::StrFormat(", %d without records removed", report.removed) : "",
      Spoken(spent));
  if (report.robot_images > 0) {
    absl::StrAppendFormat(&text,
                          "of robot images    %d\n"
                          "size               %.1f MiB, %.1f %% of their masks\n",
                          report.robot_images, static_cast<double>(report.bytes) / (1 << 20),
                          100 * ShareOfMasks(report));
  }
  if (report.unreadable > 0) {
    absl::StrAppendFormat(
        &text,
        "left out           %d records that cannot be read; name them with: silhouette-db verify "
        "%s\n",
        report.unreadable, options.database);
  }
  return text;
}

nlohmann::json JsonOf(const IndexBuildReport& report, absl::Duration spent) {
  return {{"complete", !report.stopped},
          {"tiles", report.tiles},
          {"built", report.built},
          {"fresh_already", report.done - report.built - report.removed},
          {"removed", report.removed},
          {"robot_images", report.robot_images},
          {"unreadable", report.unreadable},
          {"bytes", report.bytes},
          {"mask_bytes", report.mask_bytes},
          {"share_of_masks", ShareOfMasks(report)},
          {"seconds", absl::ToDoubleSeconds(spent)}};
}

absl::StatusOr<ExitCode> Index(const IndexOptions& options) {
  absl::StatusOr<std::unique_ptr<Database>> database =
      Database::Open(options.database, Database::Access::kWrite);
  if (database.ok() && !options.variant.empty())
    database = (*database)->OpenVariant(options.variant);
  if (!database.ok()) return database.status();
  CatchStopSignals();
  const absl::Time started = absl::Now();
  ASSIGN_OR_RETURN(const auto report, BuildWithProgress(**database, options.all));
  const absl::Duration spent = absl::Now() - started;
  Print(options.format, TextOf(options, report, spent), JsonOf(report, spent));
  if (!report.stopped) return kDone;
  std::cerr << "stopped, " << report.tiles - report.done
            << " tiles are left; what is built stays; go on with: " << options.Command()
            << (options.all ? " (begins with the first again)" : "") << std::endl;
  return kNo;
}

}  // namespace

void AddIndex(CLI::App& app, Work& work) {
  auto [command, options] = AddCommand(
      app, work, "index",
      "Builds the collision index: by it the server tests the whole configuration space at once",
      Index);
  AddDatabaseArgument(command, options.database);
  command.add_option("--variant", options.variant, "Only of this variant; default: of all");
  command.add_flag("--all", options.all,
                   "Also the tiles that are fresh; by default only those whose records have "
                   "changed since");
  AddFormatOption(command, options.format);
  command.footer(
      "silhouette-capture builds it at the end of a capture; after an import, or a change of\n"
      "records, this does. What is built stays, whatever happens: the same command goes on.\n"
      "Example:\n  silhouette-db index cell.lmdb\n"
      "Exit codes: 0 all is built; 1 stopped; 2 a mistake in what was asked; 3 the disk failed.");
}

}  // namespace silhouette
