// SPDX-License-Identifier: Apache-2.0
// silhouette-capture remask: rebuilds the masks from the stored camera images.
#include <unistd.h>

#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "capture/session/remask.h"
#include "common/result/result.h"
#include "db/status/status_macros.h"
#include "db/store/collision_index.h"
#include "db/store/writer_lock.h"
#include "tools/program/progress.h"
#include "tools/silhouette-capture/commands.h"
#include "tools/silhouette-capture/opened_cell.h"

namespace silhouette {
namespace {

constexpr char kRemaskProgram[] = "silhouette-capture remask";

struct RemaskArguments {
  CellArguments cell;
  std::string into;
  bool leave_out = false;
  bool no_index = false;
};

// An empty database beside the place where it, or its masks, will be. What an earlier attempt left
// there goes. FailedPrecondition: another remask is writing there.
absl::StatusOr<std::unique_ptr<Database>> MakeBeside(const std::string& folder,
                                                     storage::v1::CellDescription description,
                                                     const Cell& cell, const Database& source) {
  if (std::filesystem::exists(folder)) {
    ASSIGN_OR_RETURN(const WriterLock lock, WriterLock::Take(folder));
    RemoveDatabase(folder);
  }
  description.set_segmentation(Describe(cell.segmentation));
  *description.mutable_tile_edges() = source.cell().tile_edges();
  return Database::Create(folder, description);
}

absl::StatusOr<std::vector<RemaskedVariant>> MakeMasks(const RemaskArguments& options,
                                                       const CellFile& file,
                                                       const Database& database, Database& into) {
  RemaskOptions remask;
  remask.segmentation = file.cell.segmentation;
  remask.leave_out = options.leave_out;
  std::optional<Progress> progress;
  remask.progress = [&](uint64_t done, uint64_t total) {
    if (!progress && total > 0) progress.emplace("masks", total, "configurations");
    if (progress) progress->Update(done);
    return !StopRequested();
  };
  auto made = Remask(database, remask, kRemaskProgram, into);
  if (absl::IsFailedPrecondition(made.status())) {
    return absl::FailedPreconditionError(
        absl::StrCat(made.status().message(),
                     "; images are kept with 'raw_images: all' of 'capture' in the cell file. Put "
                     "those that can be made into another database: --into FOLDER --leave-out"));
  }
  return made;
}

absl::Status RemaskBuildIndex(const RemaskArguments& options, Database& database) {
  if (options.no_index) return absl::OkStatus();
  return BuildCollisionIndex(database).status();
}

// Reference images and calibration.
absl::Status CopyCell(const Database& source, Database& into) {
  ASSIGN_OR_RETURN(const auto snapshot, source.Read());
  ASSIGN_OR_RETURN(const auto references, snapshot.References());
  if (references) RETURN_IF_ERROR(into.SetReferences(*references, kRemaskProgram));
  ASSIGN_OR_RETURN(const auto calibration, snapshot.Calibration());
  if (calibration) RETURN_IF_ERROR(into.SetCalibration(*calibration, kRemaskProgram));
  return absl::OkStatus();
}

// Into a new database, which is there once it is whole.
absl::StatusOr<std::vector<RemaskedVariant>> RemaskInto(const RemaskArguments& options,
                                                        const CellFile& file) {
  ASSIGN_OR_RETURN(const auto source,
                   OpenDatabaseOfOtherMasks(file, Database::Access::kRead, true));
  // What a session stores, or finds suspect, meanwhile would not be in the new database.
  ASSIGN_OR_RETURN(const int guard, WriterLock::KeepWritersOut(file.database, "; end that first"));
  const absl::Cleanup let_writers_in = [guard] { close(guard); };
  const std::string part = BesideDatabase(options.into, ".part");
  ASSIGN_OR_RETURN(auto database, MakeBeside(part, DescriptionOf(file.cell), file.cell, *source));
  absl::Cleanup remove = [&] {
    database.reset();
    RemoveDatabase(part);
  };
  RETURN_IF_ERROR(CopyCell(*source, *database));
  auto made = MakeMasks(options, file, *source, *database);
  if (!made.ok()) return made;
  RETURN_IF_ERROR(RemaskBuildIndex(options, *database));
  database.reset();
  std::move(remove).Cancel();
  std::error_code error;
  std::filesystem::rename(part, options.into, error);
  if (!error) return made;
  return absl::InternalError(
      absl::StrCat("'", part, "' cannot be renamed to '", options.into, "': ", error.message()));
}

// In their place: made in a database beside it, then exchanged in one change.
absl::StatusOr<std::vector<RemaskedVariant>> RemaskInPlace(const RemaskArguments& options,
                                                           const CellFile& file) {
  ASSIGN_OR_RETURN(const auto database,
                   OpenDatabaseOfOtherMasks(file, Database::Access::kWrite, false));
  const std::string beside = BesideDatabase(file.database, ".remask");
  ASSIGN_OR_RETURN(auto masks, MakeBeside(beside, database->cell(), file.cell, *database));
  const absl::Cleanup remove = [&] {
    masks.reset();
    RemoveDatabase(beside);
  };
  auto made = MakeMasks(options, file, *database, *masks);
  if (!made.ok()) return made;
  RETURN_IF_ERROR(database->ReplaceMasks(*masks, kRemaskProgram));
  RETURN_IF_ERROR(RemaskBuildIndex(options, *database));
  return made;
}

std::string RemaskText(const std::string& where, const std::vector<RemaskedVariant>& made) {
  std::string text;
  for (const RemaskedVariant& variant : made) {
    if (made.size() > 1) absl::StrAppendFormat(&text, "variant '%s'\n", variant.name);
    absl::StrAppendFormat(&text, "masks rebuilt      %d configurations, in %s\n",
                          variant.configurations, where);
    if (variant.excluded > 0) {
      absl::StrAppendFormat(&text, "excluded           %d\n", variant.excluded);
    }
    if (variant.left_out > 0) {
      absl::StrAppendFormat(&text, "left out           %d, without raw images\n", variant.left_out);
    }
    Table table{{"view", "masks changed", "pixels before", "added", "removed"}};
    for (const ViewChange& view : variant.views) {
      table.rows.push_back({view.name, absl::StrCat(view.images), absl::StrCat(view.before),
                            absl::StrCat(view.added), absl::StrCat(view.removed)});
    }
    text += TextOf(table);
  }
  return text;
}

nlohmann::ordered_json RemaskJson(const RemaskedVariant& variant) {
  nlohmann::ordered_json json = {{"configurations", variant.configurations},
                                 {"excluded", variant.excluded},
                                 {"left_out", variant.left_out},
                                 {"views", nlohmann::ordered_json::array()}};
  for (const ViewChange& view : variant.views) {
    json["views"].push_back({{"name", view.name},
                             {"masks_changed", view.images},
                             {"pixels_before", view.before},
                             {"pixels_added", view.added},
                             {"pixels_removed", view.removed}});
  }
  return json;
}

RemaskedVariant Together(const std::vector<RemaskedVariant>& variants) {
  RemaskedVariant sum;
  for (const RemaskedVariant& variant : variants) {
    sum.configurations += variant.configurations;
    sum.excluded += variant.excluded;
    sum.left_out += variant.left_out;
    sum.views.resize(variant.views.size());
    for (size_t v = 0; v < variant.views.size(); ++v) {
      sum.views[v].name = variant.views[v].name;
      sum.views[v].images += variant.views[v].images;
      sum.views[v].added += variant.views[v].added;
      sum.views[v].removed += variant.views[v].removed;
      sum.views[v].before += variant.views[v].before;
    }
  }
  return sum;
}

nlohmann::ordered_json RemaskJson(const std::string& where,
                                  const std::vector<RemaskedVariant>& made) {
  nlohmann::ordered_json json = RemaskJson(Together(made));
  json["database"] = where;
  for (const RemaskedVariant& variant : made) {
    json["variants"].push_back(RemaskJson(variant));
    json["variants"].back()["name"] = variant.name;
  }
  return json;
}

absl::StatusOr<ExitCode> RemaskRun(const RemaskArguments& options) {
  ASSIGN_OR_RETURN(const CellFile file, OpenCellFile(options.cell));
  const bool into = !options.into.empty();
  if (options.leave_out && !into) {
    return absl::InvalidArgumentError(
        "--leave-out goes with --into: robot images are not dropped from where they are");
  }
  if (into && std::filesystem::exists(options.into)) {
    return absl::AlreadyExistsError(
        absl::StrCat("there is '", options.into, "' already; name a new folder"));
  }
  CatchStopSignals();
  const auto made = into ? RemaskInto(options, file) : RemaskInPlace(options, file);
  if (absl::IsCancelled(made.status())) {
    std::cerr << made.status().message() << std::endl;
    return kNo;
  }
  if (!made.ok()) return made.status();
  const std::string& where = into ? options.into : file.database;
  PrintResult(options.cell.format, RemaskJson(where, *made), RemaskText(where, *made));
  return kDone;
}

}  // namespace

void AddRemask(CLI::App& app, Work& work) {
  CLI::App* command = app.add_subcommand(
      "remask",
      "Rebuilds all masks of all variants from the stored camera images (capture:\n"
      "{raw_images: all}) with the segmentation settings of the cell file. The robot does not\n"
      "move. All masks change at once, or none: a stopped or killed run leaves the database as it\n"
      "was. The masks are built in a folder beside it (NAME.remask), which needs disk space\n"
      "meanwhile. Reports how many pixels changed.");
  command->footer(
      "Examples:\n"
      "  silhouette-capture remask --cell cell.yaml --database cell.lmdb\n"
      "  silhouette-capture remask --cell finer.yaml --database cell.lmdb --into finer.lmdb\n"
      "Exit codes: 0 done; 1 stopped; 2 wrong arguments or files; 3 the disk failed.");
  const auto options = std::make_shared<RemaskArguments>();
  AddCellOptions(*command, options->cell);
  command->add_option(
      "--into", options->into,
      "Write the new masks into a new database in this folder, without raw images, but with\n"
      "reference images, calibration and what is suspect; the other stays as it is. The masks\n"
      "may have another size");
  command->add_flag("--leave-out", options->leave_out,
                    "With --into: leave out robot images that have no raw images");
  command->add_flag("--no-index", options->no_index,
                    "Leave the collision index out; silhouette-db index builds it");
  command->callback([options, &work] { work = [options] { return RemaskRun(*options); }; });
}

}  // namespace silhouette
