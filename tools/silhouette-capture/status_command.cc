// SPDX-License-Identifier: Apache-2.0
// silhouette-capture status: what is there, what is missing, what to do next.
#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/result/result.h"
#include "db/status/status_macros.h"
#include "tools/silhouette-capture/commands.h"
#include "tools/silhouette-capture/opened_cell.h"
#include "tools/silhouette-capture/session_facts.h"

namespace silhouette {
namespace {

struct Status {
  bool database = false;
  bool drawn = false;          // no robot image is captured
  bool verified = false;       // the model that they are drawn from, as it is now
  bool cameras = false;        // a view has one; else masks are imported
  bool camera_models = false;  // a calibration with them is stored
  int references = 0;          // images per view that they were made from; 0: none
  VariantFacts variant;

  bool complete() const {
    if (cameras && references == 0) return false;
    return drawn ? camera_models && verified : variant.missing == 0 && variant.good();
  }
};

absl::StatusOr<Status> Look(const CellFile& file) {
  Status status;
  status.drawn = file.cell.robot.drawn.has_value();
  status.cameras = std::ranges::any_of(
      file.cell.views, [](const ViewSettings& view) { return HasImages(view.source); });
  status.variant.name = file.variant;
  status.variant.missing = file.cell.grid.size();
  auto database = OpenDatabase(file, Database::Access::kRead);
  const bool no_variant =
      absl::IsNotFound(database.status()) && file.variant != schema::kDefaultVariant;
  if (no_variant) {
    // The reference images are of all variants.
    CellFile others = file;
    others.variant = schema::kDefaultVariant;
    database = OpenDatabase(others, Database::Access::kRead);
  }
  if (absl::IsNotFound(database.status())) return status;
  if (!database.ok()) return database.status();
  status.database = true;
  ASSIGN_OR_RETURN(const auto snapshot, (*database)->Read());
  ASSIGN_OR_RETURN(const auto references, snapshot.References());
  if (references.has_value()) status.references = std::max(1, references->views(0).images());
  status.verified = HasVerifiedModel(file.cell, **database, snapshot);
  status.camera_models = HasCameraModels(snapshot);
  if (no_variant) return status;
  ASSIGN_OR_RETURN(status.variant, FactsOf(**database));
  return status;
}

// The next command; empty: there is nothing left to do.
std::string Next(const CellArguments& arguments, const CellFile& file, const Status& status) {
  if (status.cameras && status.references == 0) return arguments.Command("reference");
  if (status.drawn && !status.camera_models) return ImportCamerasCommand(file);
  if (status.drawn) return status.verified ? "" : arguments.Command("verify-model");
  if (!status.cameras && !status.complete()) {
    return arguments.Command("import", "silhouette-db") +
           (status.variant.damaged > 0 ? " --replace FOLDER" : " FOLDER");
  }
  if (status.variant.missing > 0) return arguments.Command("run");
  if (status.variant.suspect > 0) return arguments.Command("run") + " --only suspect";
  if (status.variant.damaged > 0) return arguments.Command("run") + " --only outliers";
  return "";
}

std::string StatusText(const CellFile& file, const Status& status, const std::string& next) {
  const VariantFacts& variant = status.variant;
  std::string text =
      absl::StrFormat("cell '%s', database %s%s%s\n", file.cell.name, file.database,
                      status.database ? "" : " (not there yet)",
                      file.variant == schema::kDefaultVariant ? "" : ", variant " + file.variant);
  absl::StrAppend(&text, "reference images   ",
                  status.references > 0 ? absl::StrCat(status.references, " per view") : "none",
                  "\n");
  if (status.drawn) {
    return absl::StrCat(text, "robot images       drawn from the model, which is ",
                        status.verified ? "verified" : "not verified",
                        next.empty() ? "" : "\nnext: ", next, "\n");
  }
  absl::StrAppendFormat(
      &text, "configurations     %d: %d captured, %d excluded, %d damaged, %d missing\n",
      file.cell.grid.size(), variant.captured, variant.excluded, variant.damaged, variant.missing);
  if (variant.suspect > 0) {
    absl::StrAppendFormat(&text,
                          "suspect            %d, captured while the cell may have changed\n",
                          variant.suspect);
  }
  return text + (next.empty() ? "all is captured" : "next: " + next) + "\n";
}

absl::StatusOr<ExitCode> StatusRun(const CellArguments& arguments) {
  ASSIGN_OR_RETURN(const CellFile file, OpenCellFile(arguments));
  ASSIGN_OR_RETURN(const Status status, Look(file));
  const std::string next = Next(arguments, file, status);
  nlohmann::ordered_json json = {{"cell", file.cell.name},
                                 {"database", file.database},
                                 {"database_exists", status.database},
                                 {"variant", file.variant},
                                 {"reference_images", status.references},
                                 {"configurations", file.cell.grid.size()},
                                 {"complete", status.complete()},
                                 {"next", next}};
  json.update(JsonOf(status.variant));
  PrintResult(arguments.format, json, StatusText(file, status, next));
  return status.complete() ? kDone : kNo;
}

}  // namespace

void AddStatus(CLI::App& app, Work& work) {
  CLI::App* command = app.add_subcommand(
      "status",
      "Shows what is captured, what is missing and what to do next. Works during a capture.\n"
      "Exit code 0: all is captured, or drawn from a verified model; 1: something is missing.");
  command->footer("Example:\n  silhouette-capture status --cell cell.yaml --database cell.lmdb");
  const auto arguments = std::make_shared<CellArguments>();
  AddCellOptions(*command, *arguments);
  AddVariantOption(*command, *arguments);
  command->callback([arguments, &work] { work = [arguments] { return StatusRun(*arguments); }; });
}

}  // namespace silhouette
