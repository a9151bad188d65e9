// SPDX-License-Identifier: Apache-2.0
// silhouette-capture remask: makes the masks anew from the images that were kept.
#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <thread>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "capture/session/remask.h"
#include "db/status/status_macros.h"
#include "db/store/collision_index.h"
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
// there goes.
absl::StatusOr<std::unique_ptr<Database>> MakeBeside(const std::string& folder,
                                                     storage::v1::CellDescription description,
                                                     const Cell& cell, const Database& source) {
  std::error_code ignored;
  std::filesystem::remove_all(folder, ignored);
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
  remask.threads = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
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

absl::Status CopyReferences(const Database& source, Database& into) {
  ASSIGN_OR_RETURN(const auto references, source.Read()->References());
  if (!references.has_value()) return absl::OkStatus();
  return into.SetReferences(*references, kRemaskProgram);
}

// Into a new database, which is there once it is whole.
absl::StatusOr<std::vector<RemaskedVariant>> RemaskInto(const RemaskArguments& options,
                                                        const CellFile& file) {
  ASSIGN_OR_RETURN(const auto source,
                   OpenDatabaseOfOtherMasks(file, Database::Access::kRead, true));
  const std::string part = options.into + ".part";
  ASSIGN_OR_RETURN(auto database, MakeBeside(part, DescriptionOf(file.cell), file.cell, *source));
  absl::Cleanup remove = [&] {
    std::error_code ignored;
    std::filesystem::remove_all(part, ignored);
  };
  RETURN_IF_ERROR(CopyReferences(*source, *database));
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
    std::error_code ignored;
    std::filesystem::remove_all(beside, ignored);
  };
  auto made = MakeMasks(options, file, *database, *masks);
  if (!made.ok()) return made;
  RETURN_IF_ERROR(database->ReplaceMasks(*masks, kRemaskProgram));
  RETURN_IF_ERROR(RemaskBuildIndex(options, *database));
  return made;
}

void RemaskPrintText(const std::string& where, const std::vector<RemaskedVariant>& made) {
  for (const RemaskedVariant& variant : made) {
    if (made.size() > 1) std::cout << absl::StreamFormat("variant '%s'\n", variant.name);
    std::cout << absl::StreamFormat("masks made anew    %d configurations, in %s\n",
                                    variant.configurations, where);
    if (variant.excluded > 0)
      std::cout << absl::StreamFormat("excluded           %d\n", variant.excluded);
    if (variant.left_out > 0) {
      std::cout << absl::StreamFormat("left out           %d, without raw images\n",
                                      variant.left_out);
    }
    std::cout << "view                masks changed   pixels before        added      removed\n";
    for (const ViewChange& view : variant.views) {
      std::cout << absl::StreamFormat("  %-16s  %13d   %13d   %10d   %10d\n", view.name,
                                      view.images, view.before, view.added, view.removed);
    }
  }
  std::cout << std::flush;
}

nlohmann::json Json(const RemaskedVariant& variant) {
  nlohmann::json json = {{"configurations", variant.configurations},
                         {"excluded", variant.excluded},
                         {"left_out", variant.left_out},
                         {"views", nlohmann::json::array()}};
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

void RemaskPrintJson(const std::string& where, const std::vector<RemaskedVariant>& made) {
  nlohmann::json json = Json(Together(made));
  json["database"] = where;
  for (const RemaskedVariant& variant : made) {
    json["variants"].push_back(Json(variant));
    json["variants"].back()["name"] = variant.name;
  }
  std::cout << json.dump(2) << std::endl;
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
  options.cell.json() ? RemaskPrintJson(where, *made) : RemaskPrintText(where, *made);
  return kDone;
}

}  // namespace

void AddRemask(CLI::App& app, Work& work) {
  CLI::App* command = app.add_subcommand(
      "remask",
      "Makes all masks of all variants anew from the camera images that were kept (capture:\n"
      "{raw_images: all}), with the segmentation settings of the cell file; the robot does not "
      "move.\n"
      "All masks change at once, or none: stopped or killed, it leaves the database as it was. "
      "They "
      "are\n"
      "made in a folder beside it (NAME.remask), which needs room meanwhile. Says how many pixels\n"
      "changed.");
  command->footer(
      "Examples:\n"
      "  silhouette-capture remask --cell cell.yaml --database cell.lmdb\n"
      "  silhouette-capture remask --cell finer.yaml --database cell.lmdb --into finer.lmdb\n"
      "Exit codes: 0 done; 1 stopped; 2 a mistake in what was asked; 3 the disk failed.");
  const auto options = std::make_shared<RemaskArguments>();
  AddCellOptions(*command, options->cell);
  command->add_option(
      "--into", options->into,
      "A new folder for a database with the new masks; the other stays as it is. It "
      "gets\nno raw images. Masks may have another size there");
  command->add_flag("--leave-out", options->leave_out,
                    "With --into: leave out robot images that have no raw images");
  command->add_flag("--no-index", options->no_index,
                    "Leave the collision index out; silhouette-db index builds it");
  command->callback([options, &work] { work = [options] { return RemaskRun(*options); }; });
}

}  // namespace silhouette
