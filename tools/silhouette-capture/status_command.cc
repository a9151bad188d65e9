// SPDX-License-Identifier: Apache-2.0
// silhouette-capture status: what is there, what is missing, what to do next.
#include <algorithm>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "absl/strings/str_format.h"
#include "capture/session/capture_plan.h"
#include "capture/session/history.h"
#include "db/status/status_macros.h"
#include "tools/silhouette-capture/commands.h"
#include "tools/silhouette-capture/opened_cell.h"

namespace silhouette {
namespace {

struct Standing {
  bool database = false;
  int references = 0;  // images per view that they were made from; 0: none
  uint64_t configurations = 0;
  uint64_t captured = 0;
  uint64_t excluded = 0;
  uint64_t damaged = 0;
  uint64_t suspect = 0;  // of the captured ones
  uint64_t missing() const { return configurations - captured - excluded - damaged; }
  bool complete() const { return references > 0 && missing() == 0 && damaged == 0 && suspect == 0; }
};

absl::StatusOr<Standing> Look(const CellFile& file) {
  Standing standing;
  standing.configurations = file.cell.grid.size();
  auto database = OpenDatabase(file, Database::Access::kRead);
  const bool no_variant =
      absl::IsNotFound(database.status()) && file.variant != schema::kDefaultVariant;
  if (no_variant) {
    // The reference images are of all variants.
    CellFile others = file;
    others.variant = schema::kDefaultVariant;
    database = OpenDatabase(others, Database::Access::kRead);
  }
  if (absl::IsNotFound(database.status())) return standing;
  if (!database.ok()) return database.status();
  standing.database = true;
  ASSIGN_OR_RETURN(const auto snapshot, (*database)->Read());
  ASSIGN_OR_RETURN(const auto references, snapshot.References());
  if (references.has_value()) standing.references = std::max(1, references->views(0).images());
  if (no_variant) return standing;
  ASSIGN_OR_RETURN(const auto records, ReadRecords(**database));
  const auto count = [&](StoredRecord kind) {
    return static_cast<uint64_t>(std::count(records.begin(), records.end(), kind));
  };
  standing.captured = count(StoredRecord::kCaptured);
  standing.excluded = count(StoredRecord::kExcluded);
  standing.damaged = count(StoredRecord::kDamaged);
  ASSIGN_OR_RETURN(const auto suspects, SuspectNumbers(snapshot));
  standing.suspect = suspects.size();
  return standing;
}

// The next command; empty: there is nothing left to do.
std::string Next(const CellArguments& arguments, const Standing& standing) {
  if (standing.references == 0) return arguments.Command("reference");
  if (standing.missing() > 0) return arguments.Command("run");
  if (standing.suspect > 0) return arguments.Command("run") + " --only suspect";
  if (standing.damaged > 0) return arguments.Command("run") + " --only outliers";
  return "";
}

void StatusPrintText(const CellFile& file, const Standing& standing, const std::string& next) {
  std::cout << absl::StreamFormat(
      "cell '%s', database %s%s%s\n", file.cell.name, file.database,
      standing.database ? "" : " (not there yet)",
      file.variant == schema::kDefaultVariant ? "" : ", variant " + file.variant);
  if (standing.references > 0) {
    std::cout << absl::StreamFormat("reference images   %d per view\n", standing.references);
  } else {
    std::cout << "reference images   none\n";
  }
  std::cout << absl::StreamFormat(
      "configurations     %d: %d captured, %d excluded, %d damaged, %d missing\n",
      standing.configurations, standing.captured, standing.excluded, standing.damaged,
      standing.missing());
  if (standing.suspect > 0) {
    std::cout << absl::StreamFormat(
        "suspect            %d, captured while the cell may have been changed\n", standing.suspect);
  }
  std::cout << (next.empty() ? std::string("all is captured") : "next: " + next) << std::endl;
}

void StatusPrintJson(const CellFile& file, const Standing& standing, const std::string& next) {
  const nlohmann::json json = {{"cell", file.cell.name},
                               {"database", file.database},
                               {"database_exists", standing.database},
                               {"variant", file.variant},
                               {"reference_images", standing.references},
                               {"configurations", standing.configurations},
                               {"captured", standing.captured},
                               {"excluded", standing.excluded},
                               {"damaged", standing.damaged},
                               {"missing", standing.missing()},
                               {"suspect", standing.suspect},
                               {"complete", standing.complete()},
                               {"next", next}};
  std::cout << json.dump(2) << std::endl;
}

absl::StatusOr<ExitCode> StatusRun(const CellArguments& arguments) {
  ASSIGN_OR_RETURN(const CellFile file, OpenCellFile(arguments));
  ASSIGN_OR_RETURN(const Standing standing, Look(file));
  const std::string next = Next(arguments, standing);
  if (arguments.json()) {
    StatusPrintJson(file, standing, next);
  } else {
    StatusPrintText(file, standing, next);
  }
  return standing.complete() ? kDone : kNo;
}

}  // namespace

void AddStatus(CLI::App& app, Work& work) {
  CLI::App* command = app.add_subcommand(
      "status",
      "Says what is captured, what is missing and what to do next; may be asked while a\n"
      "capture goes on. Exit code 0: all is captured; 1: something is missing.");
  command->footer("Example:\n  silhouette-capture status --cell cell.yaml --database cell.lmdb");
  const auto arguments = std::make_shared<CellArguments>();
  AddCellOptions(*command, *arguments);
  AddVariantOption(*command, *arguments);
  command->callback([arguments, &work] { work = [arguments] { return StatusRun(*arguments); }; });
}

}  // namespace silhouette
